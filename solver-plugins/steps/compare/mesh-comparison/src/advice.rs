//! An element size for a target error, from the errors of runs of several sizes.

use plyflow_fixed::FixedBits;

/// An element size for a target error.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// (m).
    pub size: f64,
    /// Estimated error of the finest run itself.
    pub finest_error: f64,
    /// Why it should not be trusted much.
    pub doubt: Option<String>,
}

/// Orders of convergence that are believed: the least of a converging element, and that of linear elements for smooth results. A
/// higher one among few runs is chance, and would make the finest run look better than it is.
const ORDERS: [f64; 2] = [1.0, 2.0];

/// The largest element size whose error is at most `target`, from `measured` sizes (m) and differences from the finest run over its
/// values, the finest first (its own is 0 and says nothing).
///
/// The finest run has an error too. By Richardson's extrapolation (as in Roache's grid convergence index, J. Fluids Eng. 116, 1994)
/// differences are `C (h^p - h0^p)`, with h0 of the finest: the finest three runs tell p, within [`ORDERS`], two runs take the least.
/// So `C h0^p` is the finest run's error, and comes on top of every difference. (That index multiplies it by 3 for two runs, of which
/// it takes a higher order, and by 1.25 for three; here the least order stands for that.) Runs that converge more slowly than with
/// order 1, or not at all, are wrong by more. A difference that is smaller than that of a finer run is raised to it, as it is so by
/// chance. Between two runs the error is a power of the size; below the finest it falls in proportion, the least that a converging
/// element does. The advice is never coarser than the coarsest run.
///
/// # Panics
/// When `measured` holds fewer than two runs.
pub fn advise(measured: &[(f64, f64)], target: f64) -> Advice {
    let finest = measured[0].0;
    let mut rising: Vec<(f64, f64)> = Vec::new();
    for &(size, difference) in &measured[1..] {
        let worst = rising.last().map_or(0.0, |r| r.1).max(difference);
        match rising.last_mut() {
            Some(same) if same.0 == size => same.1 = worst,
            _ => rising.push((size, worst)),
        }
    }
    let p = order(finest, &rising);
    let (next, difference) = rising[0];
    let own = difference / ((next / finest).fixed_powf(p) - 1.0);
    let advice = |size: f64, doubt: Option<String>| Advice {
        size,
        finest_error: own,
        doubt,
    };
    if own > target {
        let size = finest * target / own;
        let doubt = format!(
            "the finest run ({:.3} mm) has an error of some {} % itself, and {target} asks for elements of {:.3} mm; run one of about that \
             size to see",
            1e3 * finest,
            rounded(100.0 * own),
            1e3 * size
        );
        return advice(size, Some(doubt));
    }
    let errors = rising.iter().map(|(size, d)| (*size, d + own));
    let errors: Vec<(f64, f64)> = std::iter::once((finest, own)).chain(errors).collect();
    for pair in errors.windows(2) {
        let [(h0, e0), (h1, e1)] = [pair[0], pair[1]];
        if e1 <= target {
            continue;
        }
        let share = if e0 > 0.0 {
            (target / e0).fixed_ln() / (e1 / e0).fixed_ln()
        } else {
            0.0
        };
        return advice(h0 * (h1 / h0).fixed_powf(share), None);
    }
    let size = errors[errors.len() - 1].0;
    let doubt = format!(
        "even the coarsest run ({:.3} mm) has an error below {target}; a coarser one may do",
        1e3 * size
    );
    advice(size, Some(doubt))
}

/// Two significant digits.
fn rounded(x: f64) -> f64 {
    let unit = 10f64.fixed_powf(x.abs().max(1e-12).fixed_log10().floor() - 1.0);
    (x / unit).round() * unit
}

/// The order p of the differences from the finest run (`rising`, by size), from those of the next two.
fn order(finest: f64, rising: &[(f64, f64)]) -> f64 {
    let [least, most] = ORDERS;
    let [(h1, d1), (h2, d2), ..] = rising else {
        return least;
    };
    if *d1 <= 0.0 {
        return least;
    }
    // Grows with p.
    let ratio = |p: f64| ((h2 / finest).fixed_powf(p) - 1.0) / ((h1 / finest).fixed_powf(p) - 1.0);
    let (mut low, mut high) = (least, most);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if ratio(middle) < d2 / d1 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}
