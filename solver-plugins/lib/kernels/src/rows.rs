//! Rows of numbers on the stack.

/// Stack rows, aligned as the ABI asks.
#[repr(align(64))]
pub struct Rows<const N: usize>(pub [f64; N]);

impl<const N: usize> Rows<N> {
    /// Zeros.
    #[inline(always)]
    pub fn zeros() -> Self {
        Self([0.0; N])
    }
}
