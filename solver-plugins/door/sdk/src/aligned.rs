//! Arrays as the ABI asks for them.

/// One cache line of doubles.
#[repr(C, align(64))]
#[derive(Debug, Clone, Copy, Default)]
struct Line([f64; 8]);

/// An array of doubles, 64-byte aligned as `plyflow.h` asks of all that a component is given, whose length is a multiple of 8.
#[derive(Debug, Clone, Default)]
pub struct Aligned(Vec<Line>);

impl Aligned {
    /// `n` zeros, rounded up to a multiple of 8.
    pub fn zeros(n: usize) -> Self {
        Self::filled(0.0, n)
    }

    /// `n` times a value, rounded up to a multiple of 8.
    pub fn filled(value: f64, n: usize) -> Self {
        Self(vec![Line([value; 8]); n.div_ceil(8)])
    }
}

impl From<&[f64]> for Aligned {
    /// The values, and zeros up to a multiple of 8.
    fn from(values: &[f64]) -> Self {
        let mut all = Self::zeros(values.len());
        all[..values.len()].copy_from_slice(values);
        all
    }
}

impl std::ops::Deref for Aligned {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        // SAFETY: a `Line` is nothing but 8 doubles (`repr(C)`, 64 bytes, aligned to 64), so the vector's lines are that many doubles in one
        // allocation; they are borrowed as `self` is.
        unsafe { std::slice::from_raw_parts(self.0.as_ptr().cast(), self.0.len() * 8) }
    }
}

impl std::ops::DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f64] {
        // SAFETY: as in `deref`; `self` is borrowed alone, and with it the lines.
        unsafe { std::slice::from_raw_parts_mut(self.0.as_mut_ptr().cast(), self.0.len() * 8) }
    }
}

/// Whether arrays that are not empty begin at 64 bytes.
#[inline(always)]
pub(crate) fn are_aligned<const N: usize>(arrays: [&[f64]; N]) -> bool {
    let at = |a: &[f64]| if a.is_empty() { 0 } else { a.as_ptr().addr() };
    arrays.iter().fold(0, |all, a| all | at(a)) % 64 == 0
}
