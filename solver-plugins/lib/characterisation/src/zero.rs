//! Where a shear test begins: the displacement at which the frame is square and the force that the load cell shows there.
//!
//! A polynomial without a constant term is 0 at zero shear. Where the data are not, it waves: with a cross-head that stands at 3 mm, with slack, or
//! with a load cell off by 4 % of its largest force the stiffness at rest comes out wrong by 6 to 24 times, and the residual does not tell.

use crate::linear::least_squares;
use nalgebra::DMatrix;
use plyflow_fixed::FixedBits;

/// What the first rows of a test say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zero {
    /// Displacement (m) that is taken for that of the square frame.
    pub displacement: f64,
    /// Force (N) that is taken for none.
    pub force: f64,
    /// Standard error of it (N).
    pub force_error: f64,
    /// And what that is of the displacement (m), where it was found by the force.
    pub displacement_error: f64,
    /// How it was found.
    pub start: Start,
}

/// How a test begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start {
    /// Force and displacement begin together.
    Together,
    /// With no force, but at another displacement: the cross-head was not set to zero.
    Displaced,
    /// With so many rows whose force stays as it is: slack, or rows from before the pull.
    Slack(usize),
    /// With a force (N) at no displacement: an offset of the load cell, a specimen that is held under tension, or yarns that stick.
    Loaded(f64),
    /// At a displacement and with a force (m, N) between which and nothing there is no row; the curve, drawn on, has so much force (N) at no displacement.
    Unclear {
        /// Of the first row (m).
        displacement: f64,
        /// At it (N).
        force: f64,
        /// Drawn on to no displacement (N).
        drawn_on: f64,
    },
}

/// Shear angle (rad) within which the frame counts as square.
const SQUARE: f64 = 0.1 * std::f64::consts::PI / 180.0;
/// Shear angles (rad) up to which the start of a test is drawn, the widest first.
const WINDOWS: [f64; 4] = [0.28, 0.14, 0.07, 0.035];
/// Forces below this part of the largest are none.
const NOTHING: f64 = 1e-3;
/// A polynomial follows rows that it lies so many times the noise from; that is known to some 10 %.
const FOLLOWED: f64 = 1.15;
/// Least rows of slack.
const SLACK_ROWS: usize = 5;
/// What counts, in standard errors.
const SURE: f64 = 4.0;

/// A polynomial through the first rows, about a displacement.
struct Drawn {
    about: f64,
    coefficients: Vec<f64>,
    /// Standard errors of the coefficients.
    errors: Vec<f64>,
    /// Slope of the line through the rows: of the curve at the first one the noise leaves little.
    rise: f64,
}

impl Drawn {
    fn at(&self, d: f64) -> f64 {
        let x = d - self.about;
        self.coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, c| sum * x + c)
    }
}

/// Deviation of the noise of a force (N), robustly, from how far each row lies off the line between its neighbours; at least 2e-4 of the largest.
fn noise(d: &[f64], f: &[f64], largest: f64) -> f64 {
    let mut off: Vec<f64> = (1..f.len().saturating_sub(1))
        .filter(|&i| d[i + 1] > d[i - 1])
        .map(|i| {
            let part = (d[i] - d[i - 1]) / (d[i + 1] - d[i - 1]);
            let line = f[i - 1] + part * (f[i + 1] - f[i - 1]);
            (f[i] - line).abs() / (1.0 + part * part + (1.0 - part).powi(2)).sqrt()
        })
        .collect();
    off.sort_by(f64::total_cmp);
    let median = off.get(off.len() / 2).copied().unwrap_or(0.0);
    (1.4826 * median).max(2e-4 * largest)
}

/// Columns of powers of `d - about` in units of `unit`, from the constant to `degree`.
fn draw(d: &[f64], f: &[f64], degree: usize, deviation: f64) -> Option<(Drawn, f64)> {
    let about = d[0];
    let unit = (d[d.len() - 1] - about).max(f64::MIN_POSITIVE);
    let matrix = DMatrix::from_fn(d.len(), degree + 1, |i, j| {
        ((d[i] - about) / unit).powi(j as i32)
    });
    let solution = least_squares(&matrix, f).ok()?;
    let freedom = (d.len() as f64 - degree as f64 - 1.0).max(1.0);
    let left = solution.rms * (d.len() as f64 / freedom).sqrt();
    let scale = |j: usize| unit.powi(j as i32);
    let size = |j: usize| {
        solution
            .spread
            .iter()
            .map(|v| v[j] * v[j])
            .sum::<f64>()
            .sqrt()
    };
    let drawn = Drawn {
        about,
        coefficients: (solution.unknowns.iter().enumerate())
            .map(|(j, c)| c / scale(j))
            .collect(),
        errors: (0..=degree)
            .map(|j| left.max(deviation) * size(j) / scale(j))
            .collect(),
        rise: 0.0,
    };
    Some((drawn, left))
}

/// The first rows, drawn: the widest window that is followed within the noise, or as well as the best of them.
fn beginning(d: &[f64], f: &[f64], side: f64, deviation: f64) -> Option<Drawn> {
    let mut all: Vec<(Drawn, f64, usize)> = Vec::new();
    for window in WINDOWS {
        let reach = d[0] + window * side / std::f64::consts::SQRT_2;
        let rows = d.partition_point(|v| *v <= reach).max(6).min(d.len());
        // A lower degree lies as far below a curve that turns up as the noise hides.
        let degree = match rows {
            ..7 => 1,
            7..12 => 2,
            _ => 3,
        };
        let (line, _) = draw(&d[..rows], &f[..rows], 1, deviation)?;
        let (mut drawn, left) = draw(&d[..rows], &f[..rows], degree, deviation)?;
        drawn.rise = line.coefficients[1];
        all.push((drawn, left, rows));
    }
    // Of few rows what is left says little.
    let told = all.iter().filter(|w| w.2 >= 12).map(|w| w.1);
    let least = told.reduce(f64::min).unwrap_or(deviation).max(deviation);
    let place = all.iter().position(|w| w.1 <= FOLLOWED * least);
    let place = place.unwrap_or(all.len() - 1);
    Some(all.swap_remove(place).0)
}

/// Rows whose force does not rise: as many as stay within the noise of those before, if they tell no slope.
fn level_rows(d: &[f64], f: &[f64], deviation: f64) -> Option<usize> {
    let (mut sum, mut rows) = (0.0, 0);
    for (i, force) in f.iter().enumerate() {
        if i >= 3 && (force - sum / i as f64).abs() > SURE * deviation {
            break;
        }
        sum += force;
        rows = i + 1;
    }
    let judged = (0.7 * rows as f64) as usize;
    if judged < SLACK_ROWS || rows == f.len() {
        return None;
    }
    let (line, _) = draw(&d[..judged], &f[..judged], 1, deviation)?;
    (line.coefficients[1].abs() <= 3.0 * line.errors[1]).then_some(rows)
}

/// Where a level force begins to rise: displacement (m), level (N), its error (N) and that of the displacement (m); `None` where a smooth curve does as well.
fn onset(d: &[f64], f: &[f64], level: usize, deviation: f64) -> Option<[f64; 4]> {
    // No more rows than a smooth curve that turns up can be followed over.
    let rows = (level + (level / 2).max(8)).min(d.len());
    if rows < level + 4 {
        return None;
    }
    let (d, f) = (&d[..rows], &f[..rows]);
    let information = |squares: f64, unknowns: f64| {
        let n = rows as f64;
        n * (squares / n + 1e-2 * deviation * deviation).fixed_ln() + unknowns * n.fixed_ln()
    };
    let smooth = (2..=4)
        .filter_map(|degree| {
            let (_, left) = draw(d, f, degree, deviation)?;
            let freedom = rows as f64 - degree as f64 - 1.0;
            Some(information(left * left * freedom, degree as f64 + 1.0))
        })
        .reduce(f64::min)?;
    let unit = d[rows - 1] - d[0];
    let hinge = |at: f64| {
        let matrix = DMatrix::from_fn(rows, 4, |i, j| ((d[i] - at).max(0.0) / unit).powi(j as i32));
        // 0 to the power of 0 is 1: the constant.
        least_squares(&matrix, f).ok()
    };
    let mut best: Option<(f64, f64)> = None;
    let (mut from, mut to) = (d[level / 2], d[level + 1]);
    for _ in 0..3 {
        let step = (to - from) / 60.0;
        for i in 0..=60 {
            let at = from + step * f64::from(i);
            let Some(found) = hinge(at) else { continue };
            if best.is_none_or(|b| found.rms < b.1) {
                best = Some((at, found.rms));
            }
        }
        let (at, _) = best?;
        (from, to) = (at - step, at + step);
    }
    let (at, left) = best?;
    let found = hinge(at)?;
    let told = information(left * left * rows as f64, 5.0);
    let slope = found.unknowns[1] / unit;
    if told > smooth - 6.0 || slope <= 0.0 {
        return None;
    }
    let before = d.iter().filter(|v| **v <= at).count().max(1);
    let error = deviation / (before as f64).sqrt();
    Some([at, found.unknowns[0], error, error.max(left) / slope])
}

/// From the first row to the next other displacement (m).
fn spacing(d: &[f64]) -> f64 {
    let next = d.iter().find(|v| **v > d[0]);
    next.map_or(0.0, |v| v - d[0])
}

/// The zero that a level force tells which then rises, where it rises beyond the `square` frame (m). `deviation`, `largest`: of the force (N).
fn after_level(
    d: &[f64],
    f: &[f64],
    (deviation, largest, square): (f64, f64, f64),
) -> Option<Zero> {
    let level = level_rows(d, f, deviation);
    let slack = level.and_then(|rows| onset(d, f, rows, deviation));
    if let Some([at, level, error, along]) = slack
        && at - d[0] > square
    {
        let rows = d.partition_point(|v| *v < at);
        let start = match at.abs() <= square && level.abs() <= (SURE * error).max(NOTHING * largest)
        {
            true => Start::Together,
            false => Start::Slack(rows),
        };
        return Some(Zero {
            displacement: at,
            force: level,
            force_error: error,
            displacement_error: along,
            start,
        });
    }
    None
}

/// Reads how a test begins off its first rows: displacement (m) and force (N) in order, `side` between the hinges (m).
///
/// A level force that then rises tells both zeros. Without one, a test that begins with no force begins where the frame is square, since any
/// fabric resists shear; one that begins with a force at no displacement has an offset, or a fabric that sticks. Everything is judged against the noise of the force.
/// `kinked`: the force may turn up for another reason than slack, as where a stitch is stretched.
pub fn find(d: &[f64], f: &[f64], side: f64, kinked: bool) -> Zero {
    let largest = f.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let right = |error: f64| Zero {
        displacement: 0.0,
        force: 0.0,
        force_error: error,
        displacement_error: 0.0,
        start: Start::Together,
    };
    let deviation = noise(d, f, largest);
    let square = SQUARE * side / std::f64::consts::SQRT_2;
    if let Some(zero) = after_level(d, f, (deviation, largest, square)).filter(|_| !kinked) {
        return zero;
    }
    let Some(drawn) = beginning(d, f, side, deviation) else {
        return right(deviation);
    };
    let (first, slope) = (drawn.coefficients[0], drawn.rise);
    let error = drawn.errors[0];
    let nothing = (SURE * error).max(NOTHING * largest);
    if d[0].abs() <= square {
        let there = drawn.at(0.0);
        let begins_at_nothing = f[0].abs() <= (3.0 * deviation).max(NOTHING * largest);
        if there.abs() <= nothing || begins_at_nothing {
            return right(error);
        }
        return Zero {
            force: there,
            start: Start::Loaded(there),
            ..right(error)
        };
    }
    if first.abs() <= nothing && slope > 0.0 {
        // It begins at the first row, or up to a row before or after: the force tells where, as far as its noise lets it.
        let (row, told) = (spacing(d), error / slope);
        let part = row * row / (row * row + told * told);
        return Zero {
            displacement: d[0] - part * first / slope,
            displacement_error: told * part.sqrt(),
            start: Start::Displaced,
            ..right(error)
        };
    }
    let drawn_on = drawn.at(0.0);
    let far = |j: usize| drawn.errors[j] * d[0].abs().powi(j as i32);
    let unsure = (0..drawn.errors.len())
        .map(far)
        .fold(0.0, FixedBits::fixed_hypot);
    if drawn_on.abs() <= (SURE * unsure).max(0.2 * first.abs()) {
        return right(error);
    }
    Zero {
        start: Start::Unclear {
            displacement: d[0],
            force: first,
            drawn_on,
        },
        ..right(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: f64 = 0.145;

    /// 90 g + 150 g^3 N/m by the frame, 101 rows to 1 rad: displacement (m), force (N).
    fn test(stiffness: f64) -> (Vec<f64>, Vec<f64>) {
        (0..=100)
            .map(|i| {
                let g = 0.01 * f64::from(i);
                let c = (0.5 * (std::f64::consts::FRAC_PI_2 - g)).cos();
                let force = (stiffness * g + 150.0 * g.powi(3)) * 2.0 * SIDE * c;
                (2.0 * SIDE * (c - std::f64::consts::FRAC_1_SQRT_2), force)
            })
            .unzip()
    }

    #[test]
    fn a_test_that_begins_right_is_left_as_it_is_however_stiff_it_is_at_rest() {
        for stiffness in [0.0, 5.0, 90.0, 900.0] {
            let (d, f) = test(stiffness);
            let zero = find(&d, &f, SIDE, false);
            assert_eq!(zero.start, Start::Together, "{stiffness}: {zero:?}");
            assert_eq!((zero.displacement, zero.force), (0.0, 0.0));
        }
        // A fabric whose yarns stick: a third of the force within the first row.
        let (d, mut f) = test(90.0);
        f[1..].iter_mut().for_each(|f| *f += 15.0);
        assert_eq!(find(&d, &f, SIDE, false).start, Start::Together);
    }

    #[test]
    fn a_zero_that_is_elsewhere_is_found() {
        let (d, f) = test(90.0);
        let near = |a: f64, b: f64, by: f64| (a - b).abs() <= by;
        for by in [3e-3, 1e-3, -2e-3] {
            let moved: Vec<f64> = d.iter().map(|d| d + by).collect();
            let zero = find(&moved, &f, SIDE, false);
            assert_eq!(zero.start, Start::Displaced, "{zero:?}");
            assert!(near(zero.displacement, by, 5e-5), "{zero:?}");
        }
        for by in [2.0, 0.5, -1.0] {
            let moved: Vec<f64> = f.iter().map(|f| f + by).collect();
            let zero = find(&d, &moved, SIDE, false);
            assert!(matches!(zero.start, Start::Loaded(_)), "{zero:?}");
            assert!(near(zero.force, by, 0.02), "{zero:?}");
        }
        for (slack, tare) in [(1.5e-3, 0.0), (4e-3, 0.7)] {
            let level = (0..30).map(|i| slack * f64::from(i) / 30.0);
            let all: Vec<f64> = level.chain(d.iter().map(|d| d + slack)).collect();
            let force: Vec<f64> = (std::iter::repeat_n(0.0, 30).chain(f.iter().copied()))
                .map(|f| f + tare)
                .collect();
            let zero = find(&all, &force, SIDE, false);
            assert!(matches!(zero.start, Start::Slack(_)), "{zero:?}");
            assert!(near(zero.displacement, slack, 5e-5), "{zero:?}");
            assert!(near(zero.force, tare, 0.02), "{zero:?}");
        }
        // Neither zero alone explains this one.
        let (moved, lifted): (Vec<f64>, Vec<f64>) =
            d.iter().zip(&f).map(|(d, f)| (d + 3e-3, f + 2.0)).unzip();
        let zero = find(&moved, &lifted, SIDE, false);
        assert!(matches!(zero.start, Start::Unclear { .. }), "{zero:?}");
    }
}
