//! A tape runs on a CPU: slowly, and as the measure of all other ways.

use crate::form::{Id, Operation, Table, Tape};

/// How often each [`Operation::Select`] took its first and its second value, in the order in which they stand.
pub type Taken = Vec<[u64; 2]>;

/// What an operation on numbers gives; `None` where that is no number, or one of what it uses is not known.
pub(crate) fn arithmetic(operation: Operation, value: impl Fn(Id) -> Option<f64>) -> Option<f64> {
    use Operation::*;
    Some(match operation {
        Add(a, b) => value(a)? + value(b)?,
        Subtract(a, b) => value(a)? - value(b)?,
        Multiply(a, b) => value(a)? * value(b)?,
        Divide(a, b) => value(a)? / value(b)?,
        Negate(a) => -value(a)?,
        Root(a) => value(a)?.sqrt(),
        Magnitude(a) => value(a)?.abs(),
        Least(a, b) => {
            let (a, b) = (value(a)?, value(b)?);
            if a < b { a } else { b }
        }
        Largest(a, b) => {
            let (a, b) = (value(a)?, value(b)?);
            if a > b { a } else { b }
        }
        CopySign(a, b) => value(a)?.copysign(value(b)?),
        PowerOfTwo(a) => f64::from_bits((value(a)?.to_bits() << 52).wrapping_add(1023 << 52)),
        Constant(bits) => f64::from_bits(bits),
        Load(_) | Less(..) | Select(..) | Find(..) | Entry(..) | Result(..) => return None,
    })
}

impl Table {
    /// Index of the last row whose first column is not above `x`, by the search that kernels do; 0 where there is none.
    pub fn find(&self, x: f64) -> usize {
        let (mut at, mut stride) = (0, self.stride as usize);
        while stride > 0 {
            let next = at + stride;
            at = if self.rows[next][0] <= x { next } else { at };
            stride /= 2;
        }
        at
    }
}

impl Tape {
    /// Does to `lanes` lanes what it says: one slice for each of [`Tape::buffers`], `[rows][lanes]`, or `[rows]` of a uniform one.
    /// Gives how often each choice was taken.
    ///
    /// # Panics
    /// When it has calls, does not keep [`Tape::check`], or a slice has another length.
    pub fn run(&self, lanes: usize, buffers: &mut [&mut [f64]]) -> Taken {
        assert!(self.calls.is_empty(), "a tape with calls cannot be run");
        assert_eq!(buffers.len(), self.buffers.len(), "buffers");
        for (buffer, slice) in self.buffers.iter().zip(&*buffers) {
            let width = if buffer.uniform { 1 } else { lanes };
            assert_eq!(slice.len(), buffer.rows as usize * width, "{}", buffer.name);
        }
        let choices = self.operations.iter();
        let choices = choices.filter(|o| matches!(o, Operation::Select(..)));
        let mut taken = vec![[0; 2]; choices.count()];
        // Truths and places are kept as numbers beside the others.
        let mut values = vec![0.0; self.operations.len()];
        for lane in 0..lanes {
            let mut choice = 0;
            for (i, operation) in self.operations.iter().enumerate() {
                let value = |id: Id| values[id.index()];
                values[i] = match *operation {
                    Operation::Load(row) => {
                        let (slice, r) = (&buffers[row.buffer as usize], row.row as usize);
                        let uniform = self.buffers[row.buffer as usize].uniform;
                        slice[if uniform { r } else { r * lanes + lane }]
                    }
                    Operation::Less(a, b) => f64::from(u8::from(value(a) < value(b))),
                    Operation::Select(truth, a, b) => {
                        let which = usize::from(value(truth) == 0.0);
                        taken[choice][which] += 1;
                        choice += 1;
                        value([a, b][which])
                    }
                    Operation::Find(table, a) => self.tables[table as usize].find(value(a)) as f64,
                    Operation::Entry(table, place, column) => {
                        self.tables[table as usize].rows[value(place) as usize][column as usize]
                    }
                    other => arithmetic(other, |id| Some(value(id))).expect("a number"),
                };
            }
            for store in &self.stores {
                let r = store.to.row as usize;
                buffers[store.to.buffer as usize][r * lanes + lane] = values[store.value.index()];
            }
        }
        taken
    }
}
