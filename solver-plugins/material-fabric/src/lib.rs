//! plyflow-material-fabric
