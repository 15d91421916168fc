//! plyflow-boundary-interpolation
