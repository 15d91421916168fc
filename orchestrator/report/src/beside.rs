//! What two runs have found, matched: the same defect before and after a change.

use crate::input::ReportInput;
use crate::judge::{Found, found};
use crate::read::{Material, Study};

/// Two defects on one ply are the same when their middles in the flat ply are nearer to each other than this (m), or than half of the
/// longer one.
const NEAR: f64 = 0.03;

/// Two runs, read.
#[derive(Debug)]
pub(crate) struct Sides<'a> {
    pub(crate) inputs: [&'a ReportInput; 2],
    pub(crate) materials: [Material; 2],
}

impl<'a> Sides<'a> {
    pub(crate) fn read(inputs: [&'a ReportInput; 2]) -> Self {
        Self {
            inputs,
            materials: inputs.map(|i| Material::read(i, true)),
        }
    }

    /// The runs that are drawn beside each other: those of whole parts with plies, by their places among these.
    pub(crate) fn studies(&self) -> Vec<[&Study; 2]> {
        let of = |k: usize| {
            self.materials[k]
                .studies
                .iter()
                .filter(|s| !s.plies.is_empty())
        };
        of(0).zip(of(1)).map(|(a, b)| [a, b]).collect()
    }
}

/// A defect of either run, or of both.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pair {
    /// As the first run and as the second one has it.
    pub(crate) of: [Option<Found>; 2],
}

impl Pair {
    /// What has become of it.
    pub(crate) fn word(&self) -> &'static str {
        match &self.of {
            [Some(a), Some(b)] if a.is_wrinkle() != b.is_wrinkle() => "other kind",
            [Some(_), Some(_)] => "in both",
            [Some(_), None] => "A alone",
            _ => "B alone",
        }
    }

    /// The one that is told first.
    pub(crate) fn any(&self) -> &Found {
        let [a, b] = &self.of;
        a.as_ref().or(b.as_ref()).expect("one of them is there")
    }

    /// The larger size of both (m).
    fn size(&self) -> f64 {
        self.of
            .iter()
            .flatten()
            .map(Found::size)
            .fold(0.0, f64::max)
    }
}

/// The defects of two runs, matched from the nearest pair on, those of one kind first; the largest come first.
pub(crate) fn pairs(inputs: [&ReportInput; 2], materials: [&Material; 2]) -> Vec<Pair> {
    matched([0, 1].map(|k| found(inputs[k], materials[k])))
}

fn matched([a, b]: [Vec<Found>; 2]) -> Vec<Pair> {
    let mut near = Vec::new();
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            let apart = (x.at[0] - y.at[0]).hypot(x.at[1] - y.at[1]);
            let reach = NEAR.max(0.5 * x.length.max(y.length));
            if x.ply == y.ply && apart <= reach {
                near.push((apart, i, j));
            }
        }
    }
    // Of one kind before those that have changed their kind.
    let other = |p: &(f64, usize, usize)| a[p.1].is_wrinkle() != b[p.2].is_wrinkle();
    near.sort_by(|p, q| {
        let order = other(p).cmp(&other(q)).then(p.0.total_cmp(&q.0));
        order.then((p.1, p.2).cmp(&(q.1, q.2)))
    });
    let (mut of_a, mut of_b) = (vec![None; a.len()], vec![None; b.len()]);
    for (_, i, j) in near {
        if of_a[i].is_none() && of_b[j].is_none() {
            (of_a[i], of_b[j]) = (Some(j), Some(i));
        }
    }
    let mut all: Vec<Pair> = (a.into_iter().zip(of_a))
        .map(|(x, j)| Pair {
            of: [Some(x), j.map(|j| b[j].clone())],
        })
        .collect();
    let alone = b.into_iter().zip(of_b).filter(|(_, i)| i.is_none());
    all.extend(alone.map(|(y, _)| Pair {
        of: [None, Some(y)],
    }));
    all.sort_by(|p, q| q.size().total_cmp(&p.size()));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn defect(ply: &str, x: f64, height: Option<f64>, gap: Option<f64>) -> Found {
        Found {
            name: format!("at {x}"),
            ply: ply.into(),
            zone: None,
            at: [x, 0.0],
            height,
            length: height.map_or(0.0, |_| 0.04),
            gap,
        }
    }

    #[test]
    fn defects_are_matched_by_ply_and_the_nearest_place_of_one_kind_before_another() {
        let a = vec![
            defect("ply_1", 0.0, Some(3e-3), None),
            defect("ply_1", 0.02, Some(2e-3), None),
            defect("ply_2", 0.5, None, Some(4e-3)),
        ];
        let b = vec![
            defect("ply_1", 0.021, Some(1e-3), None),
            // Of another kind, and too far away.
            defect("ply_1", 0.001, None, Some(1e-3)),
            defect("ply_2", 0.55, None, Some(5e-3)),
        ];
        let all = matched([a, b]);
        let told: Vec<(&str, &str)> = (all.iter())
            .map(|p| (p.any().name.as_str(), p.word()))
            .collect();
        assert_eq!(
            told,
            [
                ("at 0.55", "B alone"),
                ("at 0.5", "A alone"),
                ("at 0", "other kind"),
                ("at 0.02", "in both")
            ]
        );
    }
}
