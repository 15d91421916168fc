//! plyflow-element-rf4
