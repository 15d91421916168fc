//! plyflow-forming-explicit
