//! Buffers between guard zones.

/// Doubles of a guard zone on either side of a buffer.
const GUARD: usize = 512;
/// Quiet NaNs that no arithmetic gives: what lies around a buffer, and what an output holds before the call. A
/// component that reads either gets NaN.
const GUARD_BITS: u64 = 0x7ff8_6a2d_0000_0000;
const POISON_BITS: u64 = 0x7ff8_90f5_0000_0000;

#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([f64; 8]);

/// A buffer as the contract has it: 64-byte aligned, with nothing that a component may touch around it.
#[derive(Clone)]
pub(crate) struct Guarded {
    lines: Vec<Line>,
    len: usize,
}

fn guard(i: usize) -> f64 {
    f64::from_bits(GUARD_BITS | i as u64)
}

impl Guarded {
    /// `len` times the same value.
    pub(crate) fn filled(len: usize, value: f64) -> Self {
        let lines = (2 * GUARD + len).div_ceil(8);
        let mut new = Self {
            lines: vec![Line([0.0; 8]); lines],
            len,
        };
        for (i, v) in new.all_mut().iter_mut().enumerate() {
            *v = guard(i);
        }
        new.slice_mut().fill(value);
        new
    }

    /// Zeros, as histories are at the start.
    pub(crate) fn zeros(len: usize) -> Self {
        Self::filled(len, 0.0)
    }

    /// An output that nothing was written to.
    pub(crate) fn poisoned(len: usize) -> Self {
        Self::filled(len, f64::from_bits(POISON_BITS))
    }

    /// An input.
    pub(crate) fn of(values: &[f64]) -> Self {
        let mut new = Self::zeros(values.len());
        new.slice_mut().copy_from_slice(values);
        new
    }

    fn all(&self) -> &[f64] {
        let first: *const f64 = self.lines.as_ptr().cast();
        // SAFETY: a line is nothing but 8 doubles (`repr(C)`, 64 bytes), so the vector's lines are that many doubles in one allocation, borrowed as
        // `self` is.
        unsafe { std::slice::from_raw_parts(first, 8 * self.lines.len()) }
    }

    fn all_mut(&mut self) -> &mut [f64] {
        let first: *mut f64 = self.lines.as_mut_ptr().cast();
        // SAFETY: as in `all`; `self` is borrowed alone, and with it the lines.
        unsafe { std::slice::from_raw_parts_mut(first, 8 * self.lines.len()) }
    }

    pub(crate) fn slice(&self) -> &[f64] {
        &self.all()[GUARD..GUARD + self.len]
    }

    pub(crate) fn slice_mut(&mut self) -> &mut [f64] {
        let len = self.len;
        &mut self.all_mut()[GUARD..GUARD + len]
    }

    /// For the component. It has the whole allocation in reach, as a plugin has the caller's memory.
    pub(crate) fn pointer(&mut self) -> *mut f64 {
        let first: *mut f64 = self.lines.as_mut_ptr().cast();
        // SAFETY: every buffer has a guard zone before it and one behind it (`filled`).
        unsafe { first.add(GUARD) }
    }

    /// Where the guard zones were written to: the index in the buffer (negative: before its start).
    pub(crate) fn breach(&self) -> Option<isize> {
        let end = GUARD + self.len;
        let at =
            self.all().iter().enumerate().position(|(i, v)| {
                !(GUARD..end).contains(&i) && v.to_bits() != guard(i).to_bits()
            })?;
        Some(at as isize - GUARD as isize)
    }

    /// The first place that was not written to.
    pub(crate) fn unwritten(&self) -> Option<usize> {
        self.slice().iter().position(|v| v.to_bits() == POISON_BITS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_beside_the_buffer_is_seen_where_it_was() {
        for len in [0usize, 5, 24] {
            for at in [-1isize, len as isize, len as isize + 100] {
                let mut b = Guarded::zeros(len);
                assert_eq!(b.breach(), None);
                assert_eq!(b.pointer() as usize % 64, 0);
                // SAFETY: in the guard zone before or behind the buffer, which is part of the allocation.
                unsafe { *b.pointer().offset(at) = 0.0 };
                assert_eq!(b.breach(), Some(at));
            }
        }
    }

    #[test]
    fn what_was_not_written_is_seen() {
        let mut b = Guarded::poisoned(3);
        b.slice_mut()[0] = f64::NAN;
        assert_eq!(b.unwritten(), Some(1));
    }
}
