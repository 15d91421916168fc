//! plyflow-report
