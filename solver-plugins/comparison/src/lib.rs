//! plyflow-comparison
