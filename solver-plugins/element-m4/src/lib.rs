//! plyflow-element-m4
