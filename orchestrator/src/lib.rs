//! plyflow
