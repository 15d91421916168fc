//! How far a run has come: what a checkpoint keeps besides the model.

use crate::course::history::HistoryRow;
use crate::measure::PenetrationPeak;
use crate::watch::Watched;
use plyflow_mechanics::archive::{Archive, ArchiveError};

/// How far a run has come, between two frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Frames written.
    pub frame: usize,
    /// The history so far.
    pub history: Vec<HistoryRow>,
    /// Smallest step used (s).
    pub smallest_step: f64,
    /// Of a run that begins late: how far fine plies went there by themselves (m).
    pub start_shift: Option<f64>,
    /// Largest penetrations of the frames so far, in the order of [`Forming::penetrations`](crate::Forming::penetrations).
    pub peaks: Vec<PenetrationPeak>,
    /// What the watch has seen.
    pub watched: Watched,
    /// Critical step at the last frame (s); taken again when a run is taken up.
    pub critical_step: f64,
    /// The step (s) of which the user knows; of this attempt, and not kept for another.
    told_step: Option<f64>,
}

impl Default for Course {
    fn default() -> Self {
        Self {
            frame: 0,
            history: Vec::new(),
            smallest_step: f64::INFINITY,
            start_shift: None,
            peaks: Vec::new(),
            watched: Watched::default(),
            critical_step: f64::INFINITY,
            told_step: None,
        }
    }
}

impl Course {
    /// Whether steps of `dt` (s) are so much shorter than those of which the user knows that the run takes twice as long and more;
    /// if so, how long those were.
    pub fn shorter_steps(&mut self, dt: f64) -> Option<f64> {
        let known = *self.told_step.get_or_insert(dt);
        (dt < 0.5 * known).then(|| {
            self.told_step = Some(dt);
            known
        })
    }

    /// All of it but what each attempt finds out anew.
    ///
    /// # Errors
    /// When the bytes cannot be written, or are not those of a course.
    pub fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        a.value(&mut self.frame)?;
        a.value(&mut self.history)?;
        a.value(&mut self.smallest_step)?;
        a.value(&mut self.start_shift)?;
        a.value(&mut self.peaks)?;
        a.value(&mut self.watched)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_user_is_told_once_for_each_time_that_the_step_halves() {
        let mut course = Course::default();
        let told: Vec<Option<f64>> = [2.0, 1.1, 0.9, 0.8, 0.5, 0.4, 2.0, 0.39]
            .map(|dt| course.shorter_steps(dt))
            .to_vec();
        let none = None;
        let want = [none, none, Some(2.0), none, none, Some(0.9), none, none];
        assert_eq!(told, want);
        // Another attempt begins anew.
        assert_eq!(Course::default().shorter_steps(0.1), None);
    }

    #[test]
    fn the_largest_penetrations_so_far_are_kept_in_a_checkpoint() {
        let mut course = Course {
            frame: 3,
            peaks: vec![PenetrationPeak {
                largest: 2e-6,
                largest_time: 0.1,
                place: Some([1.0, 2.0, 3.0]),
                q999: 1e-6,
                q999_time: 0.2,
                q999_place: Some([4.0, 5.0, 6.0]),
                many: true,
            }],
            ..Course::default()
        };
        let mut bytes = Vec::new();
        course.archive(&mut Archive::Save(&mut bytes)).unwrap();
        let mut again = Course::default();
        again.archive(&mut Archive::Load(&bytes)).unwrap();
        assert_eq!(again, course);
    }
}
