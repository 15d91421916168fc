//! Judges element and material components against the contract of `plyflow.h`: numbers stay finite, a
//! lane depends on itself alone, forces are derivatives of energies, and results do not depend on where
//! the observer stands. Call it in a process that may die: the component is foreign code.
//!
//! Checked are the membrane part of materials and the element part of elements; bending and patches are
//! not judged yet.

mod element;
mod material;

pub use element::check_element;
pub use material::check_material;

/// One breach of the contract.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Name of the check, e.g. `batch-independence`.
    pub check: &'static str,
    /// What was seen and what is expected.
    pub text: String,
}

fn finding(check: &'static str, text: impl Into<String>) -> Finding {
    Finding {
        check,
        text: text.into(),
    }
}

/// A reproducible sequence of numbers in -1..1 (xorshift).
struct Sequence(u64);

impl Sequence {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}
