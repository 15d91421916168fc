//! The plugin `rf4`: a four-node rotation-free shell.
