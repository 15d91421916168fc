//! plyflow-mechanics
