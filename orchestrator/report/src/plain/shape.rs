//! What the flat and the formed shape of a ply tell together. `plyflow_export` computes it, as for the files of other programs.

use plyflow_export::{Sheared, deviations, sheared};
use plyflow_model::steering::Laid;

/// A place in space (m).
type Vec3 = [f64; 3];

/// What follows from flat and formed shape, by cell; NaN where it is not known.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Shape {
    /// Thickness at constant volume (m).
    pub(crate) thickness: Option<Vec<f64>>,
    /// By family: how far the fibres have turned from the direction as laid (rad).
    pub(crate) deviation: Option<[Vec<f64>; 2]>,
}

impl Shape {
    /// Of cells with their flat and formed points. `fibres`: directions of the families; `thickness`: of the flat ply (m);
    /// `draped`: which cells have a shape.
    pub(crate) fn of(
        (flat, formed): (&[Vec3], &[Vec3]),
        cells: &[[u32; 4]],
        draped: Option<&[bool]>,
        (fibres, thickness): (Option<&Laid>, Option<f64>),
    ) -> Self {
        let any = Laid::Straight([0.0, std::f64::consts::FRAC_PI_2]);
        let laid = fibres.unwrap_or(&any);
        let in_cell = |cell: &[u32; 4]| laid.in_cell(&cell.map(|i| flat[i as usize]));
        let of = |(k, cell): (usize, &[u32; 4])| {
            let at = |points: &[Vec3]| cell.map(|i| points[i as usize]);
            let there = draped.is_none_or(|d| d[k]);
            there
                .then(|| sheared(&at(flat), &at(formed), in_cell(cell)))
                .flatten()
        };
        let shapes: Vec<_> = cells.iter().enumerate().map(of).collect();
        let thick = |t: f64| {
            let of = shapes.iter();
            of.map(|s| s.map_or(f64::NAN, |s| t / s.area_ratio))
                .collect()
        };
        let turned = || {
            let of = |(s, cell): (&Option<Sheared>, &[u32; 4])| {
                let turned = s.as_ref().and_then(|s| deviations(s, in_cell(cell)));
                turned.unwrap_or([f64::NAN; 2])
            };
            let all: Vec<_> = shapes.iter().zip(cells).map(of).collect();
            [0, 1].map(|family| all.iter().map(|d| d[family]).collect())
        };
        Self {
            thickness: thickness.map(thick),
            deviation: fibres.map(|_| turned()),
        }
    }

    /// By cell, of both families the larger deviation by size (rad).
    pub(crate) fn larger_deviation(&self) -> Option<Vec<f64>> {
        let [first, second] = self.deviation.as_ref()?;
        let larger = |(a, b): (&f64, &f64)| if b.abs() > a.abs() { *b } else { *a };
        Some(first.iter().zip(second).map(larger).collect())
    }
}
