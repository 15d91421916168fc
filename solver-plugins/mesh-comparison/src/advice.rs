//! An element size for a target error, from the errors of runs of several sizes.

/// An element size for a target error.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// (m).
    pub size: f64,
    /// Why it should not be trusted much.
    pub doubt: Option<String>,
}

/// The largest element size whose error is at most `target`, from `measured` sizes (m) and errors, the finest first (its
/// own error against itself is 0 and says nothing).
///
/// Errors are taken to grow as a power of the size between two runs (Richardson); one that is smaller than that of a finer
/// run is raised to it, as it is so by chance. Below the finest pair the power goes on as 1, the least that a converging
/// element has: so the advice is on the safe side. It is never coarser than the coarsest run.
///
/// # Panics
/// When `measured` holds fewer than two runs.
pub fn advise(measured: &[(f64, f64)], target: f64) -> Advice {
    let mut worst = 0.0f64;
    let rising: Vec<(f64, f64)> = (measured[1..].iter())
        .map(|&(size, error)| {
            worst = worst.max(error);
            (size, worst)
        })
        .collect();
    let (finest, first) = (measured[0].0, rising[0]);
    if first.1 > target {
        let size = first.0 * target / first.1;
        let doubt = (size < finest).then(|| {
            format!(
                "an error of {target} asks for elements finer ({:.3} mm) than those of any run; run one of about that size to see",
                1e3 * size
            )
        });
        return Advice { size, doubt };
    }
    for pair in rising.windows(2) {
        let [(h0, e0), (h1, e1)] = [pair[0], pair[1]];
        if e1 <= target {
            continue;
        }
        let share = if e0 > 0.0 {
            (target / e0).ln() / (e1 / e0).ln()
        } else {
            0.0
        };
        return Advice {
            size: h0 * (h1 / h0).powf(share),
            doubt: None,
        };
    }
    let size = rising[rising.len() - 1].0;
    let doubt = format!(
        "even the coarsest run ({:.3} mm) has an error below {target}; a coarser one may do",
        1e3 * size
    );
    Advice {
        size,
        doubt: Some(doubt),
    }
}
