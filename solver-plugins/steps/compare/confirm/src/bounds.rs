//! Between which bounds a size lies that was measured in several runs.

use plyflow_fixed::FixedBits;

/// Orders of convergence that are believed: the lowest gives the widest bounds.
const ORDERS: [f64; 2] = [1.0, 2.0];
/// Factor of safety where the order was observed over three element sizes (Roache 1994).
const SAFETY: f64 = 1.25;

/// A size of a defect, in the run that is confirmed and in its variants (SI).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Measured {
    /// Edge of the elements (m) and the size: first those of the run that is confirmed, then those of finer runs that have the defect, each finer
    /// than the one before.
    pub by_elements: Vec<[f64; 2]>,
    /// The size in each other variant that has the defect.
    pub others: Vec<f64>,
    /// Share of the size by which all of these runs may be wrong together.
    pub shared: f64,
}

/// Bounds of a size (SI).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The lower one, never below zero.
    pub low: f64,
    /// The upper one.
    pub high: f64,
    /// Order of convergence, where it was observed.
    pub order: Option<f64>,
}

/// What is left of the elements' error in the finest run.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Discretisation {
    /// To either side (SI).
    error: f64,
    order: Option<f64>,
}

/// The error of the finest of some runs, by Richardson's extrapolation (P. J. Roache, J. Fluids Eng. 116 (1994) 405, eq. 9):
/// `|f2 - f1| / (r^p - 1)`, with the finest f1, the next f2, and r the ratio of their element sizes. Of two sizes the order p is not known: the lowest is taken, which gives
/// the largest error. Of three or more it is that of the finest three, kept within [`ORDERS`], and the error is multiplied by 1.25. Where their differences change
/// sign nothing converges: the larger one is taken, with the lowest order.
fn discretisation(runs: &[[f64; 2]]) -> Discretisation {
    let part = |a: [f64; 2], b: [f64; 2], p: f64| {
        (b[1] - a[1]).abs() / ((a[0] / b[0]).fixed_powf(p) - 1.0)
    };
    match runs {
        [.., a, b, c] => {
            let (first, last) = (b[1] - a[1], c[1] - b[1]);
            if first * last > 0.0 {
                let p = order([a[0], b[0], c[0]], first / last);
                Discretisation {
                    error: SAFETY * part(*b, *c, p),
                    order: Some(p),
                }
            } else {
                let error = part(*a, *b, ORDERS[0]).max(part(*b, *c, ORDERS[0]));
                Discretisation { error, order: None }
            }
        }
        [a, b] => Discretisation {
            error: part(*a, *b, ORDERS[0]),
            order: None,
        },
        _ => Discretisation {
            error: 0.0,
            order: None,
        },
    }
}

/// The order p at which `(h1^p - h2^p) / (h2^p - h3^p)` is the ratio of the differences between three sizes, kept within [`ORDERS`].
fn order([h1, h2, h3]: [f64; 3], ratio: f64) -> f64 {
    // Grows with p.
    let of = |p: f64| {
        let [a, b, c] = [h1, h2, h3].map(|h| (h / h2).fixed_powf(p));
        (a - b) / (b - c)
    };
    let [mut low, mut high] = ORDERS;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if of(middle) < ratio {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Bounds of a size: about its value in the finest run, what is left of the elements' error there, what all runs share, and the changes of the other
/// variants, up and down apart, as independent contributions (root of the sum of squares, JCGM 100:2008, 5.1.2); and never narrower than what was measured.
pub fn bounds(measured: &Measured) -> Bounds {
    let runs = &measured.by_elements;
    let (first, finest) = (runs[0][1], runs[runs.len() - 1][1]);
    let left = discretisation(runs);
    let squares = |sign: f64| {
        let changes = measured
            .others
            .iter()
            .map(|v| (sign * (v - first)).max(0.0));
        let shared = measured.shared * finest;
        let of_all = left.error * left.error + shared * shared;
        changes.fold(of_all, |sum, c| sum + c * c)
    };
    let all = || {
        let of_elements = runs.iter().map(|r| r[1]);
        of_elements.chain(measured.others.iter().copied())
    };
    let low = all().fold(finest - squares(-1.0).sqrt(), f64::min);
    let high = all().fold(finest + squares(1.0).sqrt(), f64::max);
    Bounds {
        low: low.max(0.0),
        high,
        order: left.order,
    }
}
