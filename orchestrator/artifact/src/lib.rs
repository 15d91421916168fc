//! plyflow-artifact
