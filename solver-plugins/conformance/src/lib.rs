//! plyflow-conformance
