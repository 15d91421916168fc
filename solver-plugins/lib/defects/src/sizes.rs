//! Errors of pairs by the size of the defects: totals, in which a large defect counts for more than a small one, and means by class
//! of size. A mean over pairs ([`PairErrors`](crate::pairs::PairErrors)) counts every defect alike.

use crate::pairs::Pairs;
use crate::{Defect, Kind};
use serde::Deserialize;

/// Names of the classes of wrinkles by length, and of bridging by area, in results; from the smallest.
pub const CLASSES: [[&str; 3]; 2] = [["short", "medium", "long"], ["small", "medium", "large"]];

/// Where classes of size begin. Both lists increase.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct SizeClasses {
    /// Least lengths of medium and of long wrinkles (m).
    pub wrinkle_classes: [f64; 2],
    /// Least areas of medium and of large bridging (m2).
    pub bridging_classes: [f64; 2],
}

impl SizeClasses {
    /// Index of the kind, and of the class in [`CLASSES`].
    fn of(&self, defect: &Defect) -> (usize, usize) {
        let (kind, bounds) = match defect.kind {
            Kind::Wrinkle => (0, self.wrinkle_classes),
            Kind::Bridging => (1, self.bridging_classes),
        };
        let size = size(defect);
        (kind, bounds.iter().filter(|b| size >= **b).count())
    }

    /// Names of results and values: where the classes begin (m and m2).
    pub fn told(&self) -> [(String, f64, &'static str); 4] {
        let from = |kind: usize, class: usize| {
            let (name, bounds, unit) = match kind {
                0 => ("wrinkle_class_from", self.wrinkle_classes, "m"),
                _ => ("bridging_class_from", self.bridging_classes, "m2"),
            };
            let class_name = CLASSES[kind][class];
            (format!("{name}.{class_name}"), bounds[class - 1], unit)
        };
        [from(0, 1), from(0, 2), from(1, 1), from(1, 2)]
    }
}

/// What a defect is measured by: the length of a wrinkle (m), the area of bridging (m2).
fn size(defect: &Defect) -> f64 {
    match defect.kind {
        Kind::Wrinkle => defect.length,
        Kind::Bridging => defect.area,
    }
}

/// How high a wrinkle is along all of it (m2): its amplitude counts by its length. Heights do not add up, but this is about what
/// one sees of a wrinkle from its side.
fn height(defect: &Defect, length: f64) -> f64 {
    match defect.kind {
        Kind::Wrinkle => length * defect.amplitude,
        Kind::Bridging => 0.0,
    }
}

/// Sums of the sizes of what differs, and of what the other has.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Differences {
    /// Of ours from theirs, over the pairs.
    pub paired: f64,
    /// Theirs that we miss, whole.
    pub missed: f64,
    /// Ours that they have not, whole.
    pub wrong: f64,
    /// All of theirs: of pairs, and what we miss.
    pub theirs: f64,
}

impl Differences {
    fn add(&mut self, other: &Self) {
        self.paired += other.paired;
        self.missed += other.missed;
        self.wrong += other.wrong;
        self.theirs += other.theirs;
    }

    /// A part over all of theirs; `None` where they have nothing.
    fn share(&self, part: f64) -> Option<f64> {
        (self.theirs > 0.0).then(|| part / self.theirs)
    }

    /// Everything that differs over all of theirs; `None` where they have nothing.
    pub fn error(&self) -> Option<f64> {
        self.share(self.paired + self.missed + self.wrong)
    }

    /// Its parts, with the endings of their names; they add up to [`Self::error`].
    fn parts(&self) -> [(&'static str, Option<f64>); 3] {
        [
            ("paired", self.share(self.paired)),
            ("missed", self.share(self.missed)),
            ("false", self.share(self.wrong)),
        ]
    }
}

/// Defects of one kind and class.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OfClass {
    /// How many both have.
    pub pairs: usize,
    /// How many the other has alone.
    pub missed: usize,
    /// How many it has not.
    pub wrong: usize,
    /// Lengths of wrinkles (m), areas of bridging (m2).
    pub size: Differences,
    /// Amplitudes of wrinkles, each times the length that it counts by (m2); nothing for bridging.
    pub height: Differences,
    /// Sum over the pairs of the relative errors of their sizes.
    relative_size: f64,
    /// The same of their amplitudes.
    relative_amplitude: f64,
}

impl OfClass {
    fn add(&mut self, other: &Self) {
        self.pairs += other.pairs;
        self.missed += other.missed;
        self.wrong += other.wrong;
        self.size.add(&other.size);
        self.height.add(&other.height);
        self.relative_size += other.relative_size;
        self.relative_amplitude += other.relative_amplitude;
    }

    /// A sum over the pairs as their mean; `None` without one.
    fn mean(&self, sum: f64) -> Option<f64> {
        (self.pairs > 0).then(|| sum / self.pairs as f64)
    }

    fn count(&self) -> usize {
        self.pairs + self.missed + self.wrong
    }
}

/// What one model has of another's defects, by kind and class of size.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SizeErrors {
    /// `[wrinkles, bridging][class]`, the classes in the order of [`CLASSES`]. A pair, and what is missed, is of the class of theirs; what is
    /// false of that of ours.
    pub classes: [[OfClass; 3]; 2],
}

impl SizeErrors {
    /// Of our defects against theirs.
    pub fn of(ours: &[&Defect], theirs: &[&Defect], pairs: &Pairs, classes: &SizeClasses) -> Self {
        let mut errors = Self::default();
        for &(i, j) in &pairs.both {
            let (a, b) = (ours[i], theirs[j]);
            let of = errors.class(classes, b);
            let [x, y] = [a, b].map(size);
            of.pairs += 1;
            of.size.paired += (x - y).abs();
            of.size.theirs += y;
            of.relative_size += (x - y).abs() / y;
            // Both heights by the length of theirs: how long ours is counts among the lengths.
            let [high, their_height] = [a, b].map(|d| height(d, b.length));
            of.height.paired += (high - their_height).abs();
            of.height.theirs += their_height;
            of.relative_amplitude += (a.amplitude - b.amplitude).abs() / b.amplitude;
        }
        for &j in &pairs.missed {
            let b = theirs[j];
            let of = errors.class(classes, b);
            of.missed += 1;
            for (sums, whole) in [
                (&mut of.size, size(b)),
                (&mut of.height, height(b, b.length)),
            ] {
                sums.missed += whole;
                sums.theirs += whole;
            }
        }
        for &i in &pairs.wrong {
            let a = ours[i];
            let of = errors.class(classes, a);
            of.wrong += 1;
            of.size.wrong += size(a);
            of.height.wrong += height(a, a.length);
        }
        errors
    }

    fn class(&mut self, classes: &SizeClasses, of: &Defect) -> &mut OfClass {
        let (kind, class) = classes.of(of);
        &mut self.classes[kind][class]
    }

    /// Wrinkles, and bridging, of all classes.
    pub fn all(&self) -> [OfClass; 2] {
        self.classes.map(|of_kind| {
            let mut sum = OfClass::default();
            of_kind.iter().for_each(|c| sum.add(c));
            sum
        })
    }

    /// The mean of the total errors of length and of area, by how many wrinkles and how many places of bridging either model has; 1 for a kind of
    /// which theirs has none. `None` when neither has a defect.
    pub fn error(&self) -> Option<f64> {
        let all = self.all();
        let count: usize = all.iter().map(OfClass::count).sum();
        let part = |of: &OfClass| of.count() as f64 * of.size.error().unwrap_or(1.0);
        (count > 0).then(|| (part(&all[0]) + part(&all[1])) / count as f64)
    }

    /// Names of results and shares or numbers, in the order in which they are reported.
    pub fn told(&self) -> Vec<(String, f64)> {
        let mut told = Vec::new();
        let mut tell = |name: String, value: Option<f64>| told.extend(value.map(|v| (name, v)));
        tell("defect_total_error".into(), self.error());
        let all = self.all();
        let names = [
            ("wrinkles", "wrinkle_pairs", "wrinkle_length"),
            ("bridging", "bridging_pairs", "bridging_area"),
        ];
        for (kind, (_, pairs, size)) in names.into_iter().enumerate() {
            let of = &all[kind];
            tell(format!("{size}_total_error"), of.size.error());
            for (part, share) in of.size.parts() {
                tell(format!("{size}_total_error.{part}"), share);
            }
            if kind == 0 {
                tell("wrinkle_amplitude_total_error".into(), of.height.error());
            }
            tell(pairs.into(), Some(of.pairs as f64));
        }
        for (kind, (plural, pairs, size)) in names.into_iter().enumerate() {
            for (of, class) in self.classes[kind].iter().zip(CLASSES[kind]) {
                tell(format!("{pairs}.{class}"), Some(of.pairs as f64));
                tell(format!("missed_{plural}.{class}"), Some(of.missed as f64));
                tell(format!("false_{plural}.{class}"), Some(of.wrong as f64));
                let mean = of.mean(of.relative_size);
                tell(format!("{size}_error.{class}"), mean);
                if kind == 0 {
                    let mean = of.mean(of.relative_amplitude);
                    tell(format!("wrinkle_amplitude_error.{class}"), mean);
                }
                tell(format!("{size}_total_error.{class}"), of.size.error());
            }
        }
        told
    }
}
