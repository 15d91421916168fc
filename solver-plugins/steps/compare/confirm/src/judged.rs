//! How the bounds stand against the whole in smaller elements.

use crate::follow::Tracks;
use crate::runs::All;
use plyflow_model::artifact::{ConfirmedDefect, JudgedBounds};

/// Bounds whose size in the whole is known, and those of them that it lies within; `None`: there is no whole to judge by.
pub fn judged(all: &All, tracks: &Tracks, defects: &[ConfirmedDefect]) -> Option<JudgedBounds> {
    let whole = all.reference.as_ref()?;
    let sizes = || defects.iter().flat_map(|d| d.sizes.values());
    let known = sizes().filter_map(|s| Some((s, s.reference?)));
    let held = known.clone().filter(|(s, v)| (s.low..=s.high).contains(v));
    let has = |d: &&crate::follow::Followed| d.reference.as_ref().and_then(|s| s.same()).is_some();
    Some(JudgedBounds {
        step: whole.step.clone(),
        element_size: whole.element_size,
        bounds: known.clone().count(),
        held: held.count(),
        gone: tracks.followed.iter().filter(|d| !has(d)).count(),
        missed: tracks.missed,
    })
}
