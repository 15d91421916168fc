//! plyflow-surface
