//! plyflow-material-marlow
