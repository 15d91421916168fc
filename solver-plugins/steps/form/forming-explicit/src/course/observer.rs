//! Who follows a run.

use crate::course::progress::Course;
use crate::forming::Forming;
use plyflow_mechanics::energy::Ledger;
use plyflow_sdk::StepError;

/// Who follows a run.
pub trait Observer {
    /// A frame, with the model's fields of that moment.
    ///
    /// # Errors
    /// Stops the run.
    fn frame(&mut self, forming: &Forming, time: f64) -> Result<(), StepError>;
    /// Called often; may stop the run.
    ///
    /// # Errors
    /// Stops the run.
    fn tick(&mut self, forming: &Forming, energies: &Ledger, end: f64) -> Result<(), StepError>;
    /// Called often while a run that begins late finds its balance; may stop the run.
    ///
    /// # Errors
    /// Stops the run.
    fn settling(&mut self, _forming: &Forming) -> Result<(), StepError> {
        Ok(())
    }
    /// Called before anything else: may put a run at its start to where an earlier attempt was.
    ///
    /// # Errors
    /// Stops the run.
    fn resume(&mut self, _forming: &mut Forming, _course: &mut Course) -> Result<(), StepError> {
        Ok(())
    }
    /// Told when the step has halved since the start, or since it was told last.
    fn slower(&mut self, _what: &str) {}
    /// How many threads the run may use now; `None`: as many as it began with.
    fn threads(&self) -> Option<usize> {
        None
    }
    /// Called between two frames, where a run can be taken up again.
    fn between_frames(&mut self, _forming: &mut Forming, _course: &mut Course) {}
}
