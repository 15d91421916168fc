//! plyflow-model
