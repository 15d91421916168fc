//! plyflow-plugin-host
