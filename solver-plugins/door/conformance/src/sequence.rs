//! Numbers that look random and are the same every time.

/// A reproducible sequence of numbers in -1..1 (xorshift).
pub(crate) struct Sequence(pub(crate) u64);

impl Sequence {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Between two numbers.
    pub(crate) fn between(&mut self, a: f64, b: f64) -> f64 {
        a + 0.5 * (b - a) * (1.0 + self.next())
    }
}
