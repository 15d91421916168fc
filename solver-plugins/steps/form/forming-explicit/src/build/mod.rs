//! Makes a run of a scene.

pub mod apart;
pub mod bag;
pub mod bag_contacts;
pub mod dies;
pub mod drawn;
pub mod feedback;
pub mod films;
pub mod grips;
pub mod layout;
pub mod plates;
pub mod press;
pub mod rim;
pub mod stamping;
pub mod travel;
pub mod under;
pub mod zone;

pub use feedback::feed_back;
pub use zone::build_local;

use crate::error::Result;
use crate::forming::Forming;
use crate::request::Parameters;
use crate::stack::Components;
use bag::{Bag, build_bag};
use plyflow_model::scene::Process;
use press::build_press;
use stamping::build_stamping;

/// Builds the model of a whole scene.
///
/// # Errors
/// What of the scene or the parameters makes no model.
pub fn build_global(p: &Parameters, components: &dyn Components) -> Result<Forming> {
    match &p.scene.process {
        Process::DoubleDiaphragm(process) => build_bag(p, Bag::Double(process), components),
        Process::SingleDiaphragm(process) => build_bag(p, Bag::Single(process), components),
        Process::Press(press) => build_press(p, press, components),
        Process::Stamping(stamping) => build_stamping(p, stamping, components),
    }
}
