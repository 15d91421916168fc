//! Things of the plane sorted into equal bins.

/// A grid of bins over a part of the plane; each lists what was put there, in that order. Places outside count to the bin at the rim.
#[derive(Debug, Clone)]
pub struct Bins {
    low: [f64; 2],
    size: [f64; 2],
    count: [usize; 2],
    lists: Vec<Vec<u32>>,
}

impl Bins {
    /// Empty ones: `count` of `size` (m, above zero) along x and y, from `low` (m) on.
    pub fn new(low: [f64; 2], size: [f64; 2], count: [usize; 2]) -> Self {
        Self {
            low,
            size,
            count,
            lists: vec![Vec::new(); count[0] * count[1]],
        }
    }

    /// The bin along x and y that holds a place (m).
    pub fn place(&self, at: [f64; 2]) -> [usize; 2] {
        [0, 1].map(|d| {
            let along = ((at[d] - self.low[d]) / self.size[d]).max(0.0);
            (along as usize).min(self.count[d] - 1)
        })
    }

    /// Puts something into every bin from that of `low` to that of `high` (m).
    pub fn insert(&mut self, what: u32, low: [f64; 2], high: [f64; 2]) {
        let (a, b) = (self.place(low), self.place(high));
        for j in a[1]..=b[1] {
            for i in a[0]..=b[0] {
                self.lists[j * self.count[0] + i].push(what);
            }
        }
    }

    /// What lies in the bin of a place (m).
    pub fn at(&self, at: [f64; 2]) -> &[u32] {
        let [i, j] = self.place(at);
        &self.lists[j * self.count[0] + i]
    }

    /// What lies in the bins from `from` to `to`, both included, row by row along x; what lies in several comes several times.
    pub fn between(&self, from: [usize; 2], to: [usize; 2]) -> impl Iterator<Item = u32> + '_ {
        (from[1]..=to[1]).flat_map(move |j| {
            (from[0]..=to[0])
                .flat_map(move |i| &self.lists[j * self.count[0] + i])
                .copied()
        })
    }

    /// Bins along x and y.
    pub fn count(&self) -> [usize; 2] {
        self.count
    }
}
