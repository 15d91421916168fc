//! How far ties of plies give way.

use crate::forming::Forming;

/// How far tied nodes are from the points that they were laid on, the farthest: way (m), and way over the length of an element; `None` where none is
/// tied.
pub fn tie_stretch(forming: &Forming) -> Option<[f64; 2]> {
    let ties = forming.model.sheet_contacts().iter().map(|c| &c.ties);
    let ties = ties.filter(|t| !t.items.is_empty());
    let both = ties.map(|t| [t.stretch(), t.stretch_share()]);
    both.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])
}
