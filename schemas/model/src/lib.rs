//! plyflow-model

pub mod job;
