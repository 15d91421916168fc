//! A way to the answer, and the ways of a study.

use super::by_size::OfClass;
use super::measure::Measure;

/// A way to the answer: the coarse run alone, another run of the whole, fine runs of its zones, or the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// Label of the comparison that measured it.
    pub comparison: String,
    /// Its model in the names of that step's results: `global`, `other.drape`, `total` (coarse run and zones), `reference`.
    pub model: String,
    /// Name for people; with the comparison when there are several.
    pub name: String,
    /// CPU time (s).
    pub cpu_seconds: f64,
    /// Wall time (s).
    pub wall_seconds: f64,
    /// Peak memory of its largest run (bytes).
    pub peak_memory: Option<f64>,
    /// CPU time over that of the reference.
    pub share: f64,
    /// By [`Measure::ALL`], SI; absent when nothing was there to compare. Those of the reference are 0.
    pub errors: [Option<f64>; Measure::COUNT],
    /// Missed and false wrinkles, missed and false bridging; absent for the reference.
    pub counts: Option<[f64; 4]>,
    /// Its errors by kind and size of the defects, where it or the reference has one; none for the reference.
    pub classes: Vec<OfClass>,
    /// Whether it measures the others.
    pub is_reference: bool,
    /// What it is measured by, and whose costs its own is held against: the reference of this comparison, the first of those that have it. Only ways of one
    /// are held against each other.
    pub measured_by: String,
    /// When it began, if that was late (s): what came before is not in its cost.
    pub start_time: Option<f64>,
    /// By [`Measure::ALL`], whether nothing cheaper is as good. One that began late is never on the front.
    pub on_front: [bool; Measure::COUNT],
}

impl Way {
    /// One of its errors (SI).
    #[must_use]
    pub fn error(&self, measure: Measure) -> Option<f64> {
        self.errors[measure as usize]
    }

    /// Whether it is on the front of a measure.
    #[must_use]
    pub fn is_on_front(&self, measure: Measure) -> bool {
        self.on_front[measure as usize]
    }

    /// Its name, with when it began if that was late: `reference (from 0.60 s)`.
    #[must_use]
    pub fn label(&self) -> String {
        match self.start_time {
            Some(time) => format!("{} (from {time:.2} s)", self.name),
            None => self.name.clone(),
        }
    }

    /// Whether its cost is that of an answer.
    pub(super) fn is_whole(&self) -> bool {
        self.start_time.is_none()
    }
}

/// Results that count defects of one alone, in the order of [`Way::counts`].
pub const COUNTS: [&str; 4] = [
    "missed_wrinkles",
    "false_wrinkles",
    "missed_bridging",
    "false_bridging",
];

/// The ways of a study.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ways {
    /// The cheapest first.
    pub list: Vec<Way>,
    /// Whether a run of the whole measures them; else the fine runs of the zones do, in these.
    pub of_the_whole: bool,
}

impl Ways {
    /// What measures them.
    #[must_use]
    pub fn yardstick(&self) -> &'static str {
        if self.of_the_whole {
            "reference"
        } else {
            "coarse run and zones"
        }
    }

    /// The ways of each reference by themselves, in the order of the comparisons.
    #[must_use]
    pub fn by_reference(&self) -> Vec<(&str, Self)> {
        let mut groups: Vec<(&str, Self)> = Vec::new();
        for way in &self.list {
            let of = way.measured_by.as_str();
            let at = groups.iter().position(|g| g.0 == of);
            let at = at.unwrap_or_else(|| {
                let list = Vec::new();
                let of_the_whole = self.of_the_whole;
                groups.push((of, Self { list, of_the_whole }));
                groups.len() - 1
            });
            groups[at].1.list.push(way.clone());
        }
        groups
    }

    /// The front of a measure, the cheapest first: whose error nothing cheaper has or is below.
    pub(super) fn mark_fronts(&mut self) {
        for (m, measure) in Measure::ALL.into_iter().enumerate() {
            // That the reference has no error says nothing where nobody was measured.
            if !(self.list.iter()).any(|w| !w.is_reference && w.error(measure).is_some()) {
                (self.list.iter_mut()).for_each(|w| w.errors[m] = None);
                continue;
            }
            if matches!(measure, Measure::Defects | Measure::TotalDefects) {
                // That neither the way nor the reference has a defect is agreement, where others have false ones.
                let agrees = |w: &&mut Way| w.errors[m].is_none() && w.counts == Some([0.0; 4]);
                let agreeing = self.list.iter_mut().filter(agrees);
                agreeing.for_each(|w| w.errors[m] = Some(0.0));
            }
            let whole = self.list.iter().enumerate().filter(|(_, w)| w.is_whole());
            let mut told: Vec<(usize, f64)> = whole
                .filter_map(|(k, w)| Some((k, w.error(measure)?)))
                .collect();
            told.sort_by(|a, b| {
                let cost = |k: usize| self.list[k].cpu_seconds;
                cost(a.0).total_cmp(&cost(b.0)).then(a.1.total_cmp(&b.1))
            });
            let mut least = f64::INFINITY;
            for (k, error) in told {
                self.list[k].on_front[m] = error < least;
                least = least.min(error);
            }
        }
    }
}
