//! plyflow-faults
