//! Makes a run of a scene.

pub mod bag;
pub mod bag_contacts;
pub mod feedback;
pub mod films;
pub mod layout;
pub mod plates;
pub mod press;
pub mod whole;
pub mod zone;

pub use feedback::feed_back;
pub use whole::build_global;
pub use zone::build_local;
