//! The model of a whole scene, by its process.

use crate::build::bag::build_bag;
use crate::build::press::build_press;
use crate::error::FormingError;
use crate::forming::Forming;
use crate::request::Parameters;
use crate::stack::Components;
use plyflow_model::scene::Process;

/// Builds the model of a whole scene.
///
/// # Errors
/// What of the scene or the parameters makes no model.
pub fn build_global(p: &Parameters, components: &dyn Components) -> Result<Forming, FormingError> {
    match &p.scene.process {
        Process::DoubleDiaphragm(process) => build_bag(p, process, components),
        Process::Press(press) => build_press(p, press, components),
    }
}
