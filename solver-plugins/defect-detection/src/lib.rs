//! plyflow-defect-detection
