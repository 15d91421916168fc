//! plyflow-tooling
