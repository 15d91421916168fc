//! The picture-frame test: shear angle and normalised shear force from the cross-head, and the laws of yarns
//! and stitch.

use crate::csv::Table;
use crate::stitch::{StitchFit, fit_stitch};
use crate::voce::rms;
pub use crate::yarns::LIMITS;
use crate::yarns::{FEWEST_ROWS, Points, Yarns, YarnsFit, fit_yarns, joined};
use crate::zero::{self, Start, Zero};
use plyflow_fixed::FixedBits;
use serde::Deserialize;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

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
            .then(|| FRAC_PI_2 - 2.0 * cosine.fixed_acos())
    }

    /// Normalised shear force (N/m) from the cross-head's force (N) at a shear angle (rad):
    /// `F L / (2 l^2 cos((pi/2 - g)/2))`, from equal virtual work; for a specimen that fills the frame
    /// (`l = L`) the usual `F / (2 L cos((pi/2 - g)/2))`.
    pub fn normalised(&self, force: f64, angle: f64) -> f64 {
        let half = 0.5 * (FRAC_PI_2 - angle);
        force * self.side / (2.0 * self.specimen_side * self.specimen_side * half.fixed_cos())
    }
}

/// What is done about a test that does not begin with no force at no displacement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ZeroChoice {
    /// The zero that the first rows tell is taken off.
    Find,
    /// The numbers are taken as they are.
    Given,
}

/// One test: shear angle as a magnitude (rad) and normalised force (N/m).
#[derive(Debug, Clone, PartialEq)]
pub struct Test {
    /// Points from the square frame on, none of them with a sign.
    pub points: Points,
    /// Where it began, whether that was taken off or not.
    pub zero: Zero,
    /// Ends (rad) of the largest piece without a row, from the square frame on.
    pub gap: [f64; 2],
}

/// Whether a test shears far enough, in rows enough, for a law. `source`: its file.
fn check_reach(points: &Points, source: &str) -> Result<(), String> {
    let reached = points.angle.iter().fold(0.0f64, |m, g| m.max(*g));
    if reached < 5f64.to_radians() {
        return Err(format!(
            "{}: the test reaches a shear angle of {:.2} deg only; is the displacement in the unit of the header, \
             and `frame_side` right?",
            source,
            reached.to_degrees()
        ));
    }
    if points.angle.len() < FEWEST_ROWS {
        return Err(format!(
            "{}: {} rows lie after the force begins to rise; a shear curve needs at least {FEWEST_ROWS}",
            source,
            points.angle.len()
        ));
    }
    Ok(())
}

/// Ends of the largest piece without a row, from the square frame on.
fn widest_gap(angle: &[f64]) -> [f64; 2] {
    let ends = std::iter::once(0.0).chain(angle.iter().copied());
    let pieces = ends.zip(angle.iter().copied());
    pieces.fold([0.0; 2], |widest: [f64; 2], (a, b)| {
        if b - a > widest[1] - widest[0] {
            [a, b]
        } else {
            widest
        }
    })
}

impl Test {
    /// Normalises the columns `displacement` and `force` of a table. `stitched`: the test stretches a stitch, whose onset is no end of slack.
    ///
    /// # Errors
    /// Too few rows, a displacement that goes back or that the frame cannot have, a test that hardly shears.
    pub fn new(
        table: &Table,
        frame: &Frame,
        choice: ZeroChoice,
        stitched: bool,
    ) -> Result<Self, String> {
        table.at_least(FEWEST_ROWS, "a shear curve")?;
        table.goes_forward(
            "displacement",
            "one file holds one stroke, without the way back",
        )?;
        let (displacement, force) = (table.values("displacement")?, table.values("force")?);
        let (mut zero, mut first) = (zero::find(displacement, force, frame.side, stitched), 0);
        let (mut from, mut none, mut errors) = (0.0, 0.0, [0.0; 2]);
        if choice == ZeroChoice::Find {
            (from, none) = (zero.displacement, zero.force);
            first = displacement.partition_point(|d| *d < from);
            if from != 0.0 || none != 0.0 {
                let angle = |d: f64| frame.shear_angle(d).unwrap_or(0.0);
                errors = [
                    frame.normalised(zero.force_error, 0.0),
                    angle(zero.displacement_error),
                ];
            }
        } else if zero.start == Start::Together {
            (zero.displacement, zero.force) = (0.0, 0.0);
        }
        let mut points = Points {
            zero_error: errors,
            ..Points::default()
        };
        for i in first..table.rows() {
            let d = displacement[i] - from;
            let angle = frame.shear_angle(d).filter(|_| d >= -0.005 * frame.side);
            let Some(angle) = angle else {
                return Err(format!(
                    "{}: a displacement of {:.3} mm does not fit a frame with a side of {:.3} mm; it is 0 where the \
                     frame is square, grows as it is pulled and stays below {:.3} mm",
                    table.place(i),
                    1e3 * displacement[i],
                    1e3 * frame.side,
                    1e3 * frame.side * (2.0 - 2f64.sqrt())
                ));
            };
            points.angle.push(angle);
            points.force.push(frame.normalised(force[i] - none, angle));
        }
        check_reach(&points, &table.source)?;
        let gap = widest_gap(&points.angle);
        Ok(Self { points, zero, gap })
    }

    fn up_to(&self, angle: f64) -> Points {
        let p = &self.points;
        let rows = p.angle.iter().zip(&p.force).filter(|(g, _)| **g <= angle);
        let (angle, force) = rows.map(|(g, f)| (*g, *f)).unzip();
        Points {
            angle,
            force,
            zero_error: p.zero_error,
        }
    }

    /// Force at an angle, straight between the rows (N/m); `None` beyond them.
    fn force_at(&self, g: f64) -> Option<f64> {
        let p = &self.points;
        let i = p.angle.partition_point(|a| *a < g);
        let (a, b) = (i.checked_sub(1)?, (i < p.angle.len()).then_some(i)?);
        let part = (g - p.angle[a]) / (p.angle[b] - p.angle[a]).max(f64::MIN_POSITIVE);
        Some(p.force[a] + part * (p.force[b] - p.force[a]))
    }
}

/// A law of the yarns, with what it was fitted to.
#[derive(Debug, Clone)]
pub struct Law {
    /// The fit.
    pub fit: YarnsFit,
    /// Its residual over the root mean square of the forces.
    pub relative_rms: f64,
    /// Largest angle of its data (rad): beyond it the law says nothing.
    pub limit: f64,
}

impl Law {
    fn new(tests: &[Points], degree: Option<usize>) -> Result<Self, String> {
        let fit = fit_yarns(tests, degree)?;
        let (angle, force) = joined(tests);
        Ok(Self {
            relative_rms: fit.rms / rms(&force),
            limit: angle.iter().fold(0.0f64, |m, g| m.max(*g)),
            fit,
        })
    }
}

/// What picture-frame tests tell.
#[derive(Debug, Clone)]
pub struct Shear {
    /// Force of the yarns over the shear angle's size: for both signs, or for positive shear where they differ.
    pub law: Law,
    /// That for negative shear, where the signs differ.
    pub negative: Option<Law>,
    /// The stitch's part, for positive shear.
    pub stitch: Option<StitchFit>,
    /// Root mean square of measured less fitted force over that of the measured, positive shear.
    pub positive_relative_rms: f64,
    /// The same for negative shear; 0 without a test.
    pub negative_relative_rms: f64,
    /// Largest difference of a test's mean force from that of all tests of its sign, over it; 0 with one test.
    pub scatter: f64,
    /// Of which tests that is, counted through the positive ones and then the negative ones: of two there is none that is more apart than the other.
    pub apart: Vec<usize>,
}

impl Shear {
    /// The yarns' law of a sign.
    pub fn yarns(&self, g: f64) -> &Yarns {
        let law = self.negative.as_ref().filter(|_| g < 0.0);
        &law.unwrap_or(&self.law).fit.yarns
    }

    /// Normalised force (N/m), odd but for the stitch and for a law of its own for negative shear, at a signed shear angle (rad).
    pub fn force(&self, g: f64) -> f64 {
        self.yarns(g).odd(g) + self.stitch.map_or(0.0, |s| s.stitch.force(g))
    }
}

/// One law for both signs is taken for none of them where it leaves so many times more of a sign's force than that sign's own law ..
const MUCH_WORSE: f64 = 1.5;
/// .. and more than this part of the force.
const SIGNS_ALIKE: f64 = 0.02;

/// Fits the laws.
///
/// With a stitch the yarns are fitted to the negative tests, where it is slack, and the stitch to what the
/// positive tests have above the yarns. Without, the yarns are fitted to all tests; where one odd law follows a sign's tests much worse than a law of their
/// own does, each sign has its own. `degree`: of the yarns' polynomial; `None`: of 2 to 9, as in [`fit_yarns`].
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
    let kept =
        |tests: &[Test]| -> Vec<Points> { tests.iter().map(|t| t.up_to(maximum_angle)).collect() };
    let (up, down) = (kept(positive), kept(negative));
    let both: Vec<Points> = up.iter().chain(&down).cloned().collect();
    let mut law = Law::new(if with_stitch { &down } else { &both }, degree)?;
    let mut own_negative = None;
    if !with_stitch && !down.is_empty() {
        let alone = [Law::new(&up, degree)?, Law::new(&down, degree)?];
        let differs = [&up, &down].iter().zip(&alone).any(|(tests, own)| {
            let left = misfit(tests, law.limit, |g| law.fit.yarns.value(g));
            left > SIGNS_ALIKE && left > MUCH_WORSE * own.relative_rms
        });
        if differs {
            let [one, other] = alone;
            (law, own_negative) = (one, Some(other));
        }
    }
    let limit = law.limit;
    let stitch = if with_stitch {
        stitch_above(&up, &law)?
    } else {
        None
    };
    let [(scatter, apart), (of_negative, mut other)] = [positive, negative].map(scatter);
    other.iter_mut().for_each(|i| *i += positive.len());
    let (scatter, apart) = match of_negative > scatter {
        true => (of_negative, other),
        false => (scatter, apart),
    };
    let mut shear = Shear {
        law,
        negative: own_negative,
        stitch,
        positive_relative_rms: 0.0,
        negative_relative_rms: 0.0,
        scatter,
        apart,
    };
    let other = shear.negative.as_ref().map_or(limit, |l| l.limit);
    let told = [
        misfit(&up, limit, |g| shear.force(g)),
        misfit(&down, other, |g| -shear.force(-g)),
    ];
    [shear.positive_relative_rms, shear.negative_relative_rms] = told;
    Ok(shear)
}

/// The stitch in what positive tests have above the yarns' law.
fn stitch_above(positive: &[Points], law: &Law) -> Result<Option<StitchFit>, String> {
    let (angle, force) = joined(positive);
    let farthest = |angle: &[f64]| angle.iter().fold(0.0f64, |m, g| m.max(*g));
    let rows = angle.iter().zip(&force).filter(|(g, _)| **g <= law.limit);
    let (inside, rest): (Vec<f64>, Vec<f64>) =
        rows.map(|(g, f)| (*g, f - law.fit.yarns.odd(*g))).unzip();
    let fit = fit_stitch(&inside, &rest)?;
    let end = fit.stitch.angles[2];
    // A flank drawn on past the data is a guess, and past the yarns' law the material refuses it.
    if end > farthest(&inside) {
        return Err(ends_early(end, farthest(&angle), law.limit));
    }
    Ok(Some(fit))
}

/// Root mean square of forces less those of a law, up to an angle (rad), over that of the forces; 0 without any.
fn misfit(tests: &[Points], limit: f64, law: impl Fn(f64) -> f64) -> f64 {
    let (angle, force) = joined(tests);
    let kept = angle.iter().zip(&force).filter(|(g, _)| **g <= limit);
    let (rest, size): (Vec<f64>, Vec<f64>) = kept.map(|(g, f)| (f - law(*g), *f)).unzip();
    if size.is_empty() {
        0.0
    } else {
        rms(&rest) / rms(&size)
    }
}

/// Largest difference of a test's mean force from that of all, over the angles that all have, and of which tests.
fn scatter(tests: &[Test]) -> (f64, Vec<usize>) {
    let end = |t: &Test| t.points.angle.iter().fold(0.0f64, |m, g| m.max(*g));
    let limit = tests.iter().map(end).fold(f64::INFINITY, f64::min);
    let places = || (1..=50).map(|i| limit * f64::from(i) / 51.0);
    let sum = |t: &Test| places().filter_map(|g| t.force_at(g)).sum::<f64>();
    let sums: Vec<f64> = tests.iter().map(sum).collect();
    let mean = sums.iter().sum::<f64>() / sums.len().max(1) as f64;
    if tests.len() < 2 {
        return (0.0, Vec::new());
    }
    let apart: Vec<f64> = sums.iter().map(|s| (s / mean - 1.0).abs()).collect();
    let most = apart.iter().copied().fold(0.0, f64::max);
    let is_most = |i: &usize| apart[*i] > 0.999 * most;
    (most, (0..tests.len()).filter(is_most).collect())
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
