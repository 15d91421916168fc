//! The picture-frame test: shear angle and normalised shear force from the cross-head, and the laws of yarns
//! and stitch.

use crate::csv::Table;
use crate::stitch::{StitchFit, fit_stitch};
use crate::voce::rms;
use crate::yarns::{Refused, Yarns, YarnsFit, fit_yarns};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

/// Highest degree of a shear polynomial that `material-fabric` takes.
pub const MAXIMUM_DEGREE: usize = 9;
/// A force at zero shear of more than this part of the largest is taken for an offset of the load cell: the yarns' polynomial
/// is 0 there, whatever was measured.
pub const LARGEST_OFFSET: f64 = 0.1;
/// Shear angle (rad) up to which a test tells the force at zero shear ..
const START: f64 = 2.0 * std::f64::consts::PI / 180.0;
/// .. by at least so many rows.
const FEWEST_START_ROWS: usize = 5;
/// What `material-fabric` takes as the end of the fitted range (rad).
pub const LIMITS: [f64; 2] = [
    5.0 * std::f64::consts::PI / 180.0,
    80.0 * std::f64::consts::PI / 180.0,
];
/// A test with fewer rows is refused.
pub const FEWEST_ROWS: usize = 20;

/// The rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Distance between the hinges (m).
    pub side: f64,
    /// Side of the sheared part of the specimen (m).
    pub specimen_side: f64,
}

impl Frame {
    /// Shear angle (rad) when the hinges on the diagonal have moved apart by `displacement` (m):
    /// `pi/2 - 2 acos(1/sqrt 2 + d / 2L)`. `None` beyond the folded frame.
    pub fn shear_angle(&self, displacement: f64) -> Option<f64> {
        let cosine = FRAC_1_SQRT_2 + displacement / (2.0 * self.side);
        (0.0..1.0)
            .contains(&cosine)
            .then(|| FRAC_PI_2 - 2.0 * cosine.acos())
    }

    /// Normalised shear force (N/m) from the cross-head's force (N) at a shear angle (rad):
    /// `F L / (2 l^2 cos((pi/2 - g)/2))`, from equal virtual work; for a specimen that fills the frame
    /// (`l = L`) the usual `F / (2 L cos((pi/2 - g)/2))`.
    pub fn normalised(&self, force: f64, angle: f64) -> f64 {
        let half = 0.5 * (FRAC_PI_2 - angle);
        force * self.side / (2.0 * self.specimen_side * self.specimen_side * half.cos())
    }
}

/// One test: shear angle as a magnitude (rad) and normalised force (N/m).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Test {
    /// Shear angle, not signed (rad).
    pub angle: Vec<f64>,
    /// Normalised force, not signed (N/m).
    pub force: Vec<f64>,
}

impl Test {
    /// Normalises the columns `displacement` and `force` of a table.
    ///
    /// # Errors
    /// Too few rows, a displacement that goes back or that the frame cannot have, a test that hardly shears.
    pub fn new(table: &Table, frame: &Frame) -> Result<Self, String> {
        table.at_least(FEWEST_ROWS, "a shear curve")?;
        table.goes_forward(
            "displacement",
            "one file holds one stroke, without the way back",
        )?;
        let (displacement, force) = (table.values("displacement")?, table.values("force")?);
        let mut test = Self::default();
        for i in 0..table.rows() {
            let d = displacement[i];
            let angle = frame.shear_angle(d).filter(|_| d >= -0.005 * frame.side);
            let Some(angle) = angle else {
                return Err(format!(
                    "{}: a displacement of {:.3} mm does not fit a frame with a side of {:.3} mm; it is 0 where the \
                     frame is square, grows as it is pulled and stays below {:.3} mm",
                    table.place(i),
                    1e3 * d,
                    1e3 * frame.side,
                    1e3 * frame.side * (2.0 - 2f64.sqrt())
                ));
            };
            test.angle.push(angle);
            test.force.push(frame.normalised(force[i], angle));
        }
        let reached = test.largest_angle();
        if reached < 5f64.to_radians() {
            return Err(format!(
                "{}: the test reaches a shear angle of {:.2} deg only; is the displacement in the unit of the header, \
                 and `frame_side` right?",
                table.source,
                reached.to_degrees()
            ));
        }
        Ok(test)
    }

    /// Force at the square frame over the largest force, both by size: an offset of the load cell, when it is not small.
    /// It is where a straight line through the first rows meets zero shear, so that a steep start counts for nothing.
    /// 0 where the test begins beyond all of those rows.
    pub fn offset(&self) -> f64 {
        let mut rows: Vec<(f64, f64)> = (self.angle.iter().copied())
            .zip(self.force.iter().copied())
            .collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let near = rows.partition_point(|r| r.0 <= START);
        rows.truncate(near.max(FEWEST_START_ROWS));
        if rows.first().is_none_or(|r| r.0 > START) {
            return 0.0;
        }
        let n = rows.len() as f64;
        let [mean_angle, mean_force] = [|r: &(f64, f64)| r.0, |r: &(f64, f64)| r.1]
            .map(|f| rows.iter().map(f).sum::<f64>() / n);
        let square = rows.iter().map(|r| (r.0 - mean_angle).powi(2)).sum::<f64>();
        let product = (rows.iter())
            .map(|r| (r.0 - mean_angle) * (r.1 - mean_force))
            .sum::<f64>();
        let slope = if square > 0.0 { product / square } else { 0.0 };
        let largest = self.force.iter().fold(0.0f64, |m, f| m.max(f.abs()));
        if largest > 0.0 {
            (mean_force - slope * mean_angle).abs() / largest
        } else {
            0.0
        }
    }

    fn largest_angle(&self) -> f64 {
        self.angle.iter().fold(0.0f64, |m, g| m.max(*g))
    }

    fn up_to(&self, angle: f64) -> (Vec<f64>, Vec<f64>) {
        let rows = self
            .angle
            .iter()
            .zip(&self.force)
            .filter(|(g, _)| **g <= angle);
        rows.map(|(g, f)| (*g, *f)).unzip()
    }
}

/// What picture-frame tests tell.
#[derive(Debug, Clone)]
pub struct Shear {
    /// Force of the yarns over the shear angle's magnitude, zero at zero.
    pub yarns: Yarns,
    /// The polynomial that would follow the data best, where the material does not take it.
    pub refused: Option<Refused>,
    /// Root mean square residual of the yarns' fit (N/m).
    pub yarns_rms: f64,
    /// The same over the root mean square of the forces.
    pub yarns_relative_rms: f64,
    /// Condition of the yarns' fit.
    pub condition: f64,
    /// The stitch's part, for positive shear.
    pub stitch: Option<StitchFit>,
    /// Largest angle of the yarns' data (rad): beyond it the polynomial says nothing.
    pub limit: f64,
    /// Root mean square of measured less fitted force over that of the measured, positive shear.
    pub positive_relative_rms: f64,
    /// The same for negative shear; 0 without a test.
    pub negative_relative_rms: f64,
}

impl Shear {
    /// Normalised force (N/m), odd but for the stitch, at a signed shear angle (rad).
    pub fn force(&self, g: f64) -> f64 {
        self.yarns.odd(g) + self.stitch.map_or(0.0, |s| s.stitch.force(g))
    }
}

/// Fits the laws.
///
/// With a stitch the yarns are fitted to the negative tests, where it is slack, and the stitch to what the
/// positive tests have above the yarns; without, the yarns to all tests. `degree`: of the yarns' polynomial;
/// `None`: of 2 to 9, as in [`fit_yarns`].
///
/// # Errors
/// A stitch without negative tests, data that do not determine the fit or end before the stitch has failed, no data below
/// `maximum_angle` (rad).
pub fn characterise(
    positive: &[Test],
    negative: &[Test],
    with_stitch: bool,
    degree: Option<usize>,
    maximum_angle: f64,
) -> Result<Shear, String> {
    if with_stitch && negative.is_empty() {
        return Err("the stitch is what positive shear has above negative shear: give tests in `negative` too".into());
    }
    let join = |tests: &[&[Test]]| -> (Vec<f64>, Vec<f64>) {
        let (mut angle, mut force) = (Vec::new(), Vec::new());
        for test in tests.iter().copied().flatten() {
            let (g, f) = test.up_to(maximum_angle);
            angle.extend(g);
            force.extend(f);
        }
        (angle, force)
    };
    let (up, down) = (join(&[positive]), join(&[negative]));
    let own = if with_stitch {
        down.clone()
    } else {
        join(&[positive, negative])
    };
    let YarnsFit {
        yarns,
        rms: yarns_rms,
        condition,
        refused,
    } = fit_yarns(&own.0, &own.1, degree)?;
    let farthest = |angle: &[f64]| angle.iter().fold(0.0f64, |m, g| m.max(*g));
    let limit = farthest(&own.0);
    let stitch = if with_stitch {
        let rows = up.0.iter().zip(&up.1).filter(|(g, _)| **g <= limit);
        let (angle, rest): (Vec<f64>, Vec<f64>) =
            rows.map(|(g, f)| (*g, f - yarns.odd(*g))).unzip();
        let fit = fit_stitch(&angle, &rest)?;
        let end = fit.stitch.angles[2];
        // A flank drawn on past the data is a guess, and past the yarns' law the material refuses it.
        if end > farthest(&angle) {
            return Err(ends_early(end, farthest(&up.0), limit));
        }
        Some(fit)
    } else {
        None
    };
    let mut shear = Shear {
        yarns_relative_rms: yarns_rms / rms(&own.1),
        yarns_rms,
        yarns,
        refused,
        condition,
        stitch,
        limit,
        positive_relative_rms: 0.0,
        negative_relative_rms: 0.0,
    };
    let misfit = |(angle, force): &(Vec<f64>, Vec<f64>), sign: f64| {
        let kept: Vec<usize> = (0..angle.len()).filter(|&i| angle[i] <= limit).collect();
        let rest: Vec<f64> = kept
            .iter()
            .map(|&i| force[i] - sign * shear.force(sign * angle[i]))
            .collect();
        let size: Vec<f64> = kept.iter().map(|&i| force[i]).collect();
        if size.is_empty() {
            0.0
        } else {
            rms(&rest) / rms(&size)
        }
    };
    let told = [misfit(&up, 1.0), misfit(&down, -1.0)];
    [shear.positive_relative_rms, shear.negative_relative_rms] = told;
    Ok(shear)
}

/// Which tests ended (rad) before the stitch would have failed, and what to do.
fn ends_early(end: f64, positive: f64, negative: f64) -> String {
    let (which, reached, why) = if negative <= positive {
        let why = ", up to which the yarns' law holds";
        ("negative", negative, why)
    } else {
        ("positive", positive, "")
    };
    format!(
        "the {which} tests end at {:.1} deg{why}, before the stitch has failed: its falling flank, drawn on, ends at {:.1} deg; \
         shear the {which} specimens further, raise `maximum_angle` if it cut them off, or set `stitch: false`",
        reached.to_degrees(),
        end.to_degrees()
    )
}
