//! What is too little to judge.

use crate::forming::Forming;
use plyflow_model::STANDARD_GRAVITY;

/// What is no wrinkle yet (m).
const LIFTED: f64 = 1e-3;

/// Energy (J) below which shares of energies say nothing: what lifts all sheets of the run by a millimetre, the least height that
/// counts as a wrinkle. Less than that moves nothing by as much as a result tells. A part that is formed takes a thousand times as
/// much and more; a ply that only rests on a tool takes less than a thousandth of it. Of the whole, where a part is computed. Masses
/// are the sheets' own, as those that are added must not make a run less strict.
pub fn too_little(forming: &Forming) -> f64 {
    let mass: f64 = forming.model.own_masses().iter().sum();
    forming.copies() * mass * STANDARD_GRAVITY * LIFTED
}
