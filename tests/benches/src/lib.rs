//! plyflow-benches
