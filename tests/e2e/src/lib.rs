//! plyflow-e2e
