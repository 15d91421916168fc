//! The stitch of a non-crimp fabric: straight pieces up from an onset to a peak and down to an end, fitted
//! to what the stretched stitch adds to the yarns' shear force.

use crate::linear::least_squares;
use nalgebra::DMatrix;

/// Force of the stitch over the shear angle (thesis table 3.1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stitch {
    /// Shear angles (rad) where it begins to carry, carries most, and has failed.
    pub angles: [f64; 3],
    /// Its largest normalised force (N/m).
    pub peak: f64,
}

impl Stitch {
    /// Normalised force (N/m) at a shear angle (rad).
    pub fn force(&self, g: f64) -> f64 {
        let [onset, top, end] = self.angles;
        if g <= onset || g >= end {
            0.0
        } else if g <= top {
            self.peak * (g - onset) / (top - onset)
        } else {
            self.peak * (end - g) / (end - top)
        }
    }

    /// Derivatives of the force with respect to onset, peak angle, end and peak.
    fn slopes(&self, g: f64) -> [f64; 4] {
        let [onset, top, end] = self.angles;
        let (up, down) = (top - onset, end - top);
        if g <= onset || g >= end {
            [0.0; 4]
        } else if g <= top {
            let part = (g - onset) / up;
            [
                -self.peak * (top - g) / (up * up),
                -self.peak * part / up,
                0.0,
                part,
            ]
        } else {
            let part = (end - g) / down;
            [
                0.0,
                self.peak * part / down,
                self.peak * (g - top) / (down * down),
                part,
            ]
        }
    }

    fn is_ordered(&self) -> bool {
        let [onset, top, end] = self.angles;
        onset >= 0.0
            && onset < top
            && top < end
            && self.peak > 0.0
            && end.is_finite()
            && self.peak.is_finite()
    }
}

/// A fitted stitch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StitchFit {
    /// The law.
    pub stitch: Stitch,
    /// Root mean square residual (N/m).
    pub rms: f64,
    /// Condition of the last linear step, columns of length 1.
    pub condition: f64,
}

/// Fits onset, peak and end to points of shear angle (rad) and force (N/m) in any order. The first guess is
/// from straight lines through the rising and the falling flank; least squares over all points ends it.
///
/// # Errors
/// When there is no rising flank, or the data end before the stitch has failed.
pub fn fit_stitch(angle: &[f64], force: &[f64]) -> Result<StitchFit, String> {
    let mut points: Vec<(f64, f64)> = angle.iter().copied().zip(force.iter().copied()).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut stitch = guess(&points)?;
    let misfit = |s: &Stitch| -> Vec<f64> { points.iter().map(|(g, f)| f - s.force(*g)).collect() };
    let squares = |r: &[f64]| r.iter().map(|v| v * v).sum::<f64>();
    let mut residual = misfit(&stitch);
    let mut condition = f64::INFINITY;
    for _ in 0..100 {
        let solve = |from: usize| {
            let slope = |i: usize, j: usize| stitch.slopes(points[i].0)[from + j];
            let matrix = DMatrix::from_fn(points.len(), 4 - from, slope);
            least_squares(&matrix, &residual)
                .map_err(|e| format!("the stitch cannot be told from the data: {e}"))
        };
        let mut solution = solve(0)?;
        // An onset of 0 that wants to go below stays there, and the others are solved for without it.
        if stitch.angles[0] <= 0.0 && solution.unknowns[0] < 0.0 {
            solution = solve(1)?;
            solution.unknowns.insert(0, 0.0);
        }
        condition = solution.condition;
        let d = &solution.unknowns;
        let mut factor = 1.0;
        let mut moved = false;
        while factor > 1e-4 {
            let [a, b, c] = stitch.angles;
            let tried = Stitch {
                angles: [
                    (a + factor * d[0]).max(0.0),
                    b + factor * d[1],
                    c + factor * d[2],
                ],
                peak: stitch.peak + factor * d[3],
            };
            let left = misfit(&tried);
            if tried.is_ordered() && squares(&left) < squares(&residual) {
                (stitch, residual, moved) = (tried, left, true);
                break;
            }
            factor *= 0.5;
        }
        if !moved || d[..3].iter().all(|v| v.abs() < 1e-13) {
            break;
        }
    }
    let rms = (squares(&residual) / points.len() as f64).sqrt();
    Ok(StitchFit {
        stitch,
        rms,
        condition,
    })
}

fn guess(points: &[(f64, f64)]) -> Result<Stitch, String> {
    let window = (points.len() / 60).max(1);
    let smooth: Vec<(f64, f64)> = points
        .chunks(window)
        .map(|c| {
            let n = c.len() as f64;
            (
                c.iter().map(|p| p.0).sum::<f64>() / n,
                c.iter().map(|p| p.1).sum::<f64>() / n,
            )
        })
        .collect();
    let top = (0..smooth.len())
        .max_by(|a, b| smooth[*a].1.total_cmp(&smooth[*b].1))
        .unwrap_or(0);
    let Some(&(top_angle, peak)) = smooth.get(top).filter(|p| p.1 > 0.0) else {
        return Err("the positive curve never lies above the yarns': there is no stitch in the data; set `stitch: false`".into());
    };
    let flank = |side: &[(f64, f64)], what: &str| -> Result<[f64; 2], String> {
        let used: Vec<&(f64, f64)> = side
            .iter()
            .filter(|p| p.1 > 0.2 * peak && p.1 < 0.85 * peak)
            .collect();
        let matrix = DMatrix::from_fn(used.len(), 2, |i, j| if j == 0 { 1.0 } else { used[i].0 });
        let right: Vec<f64> = used.iter().map(|p| p.1).collect();
        let s = least_squares(&matrix, &right).map_err(|_| {
            format!("{what}: onset, peak and end of the stitch need data on both flanks, from below the onset to beyond the end")
        })?;
        Ok([s.unknowns[0], s.unknowns[1]])
    };
    let [a, up] = flank(
        &smooth[..top],
        "there are too few points on the rising flank of the stitch",
    )?;
    let [b, down] = flank(
        &smooth[top..],
        &format!(
            "the data end (at {:.1} deg) before the stitch has failed",
            smooth[smooth.len() - 1].0.to_degrees()
        ),
    )?;
    let meet = (a - b) / (down - up);
    let stitch = Stitch {
        angles: [(-a / up).max(0.0), meet, -b / down],
        peak: a + up * meet,
    };
    if up > 0.0 && down < 0.0 && stitch.is_ordered() {
        return Ok(stitch);
    }
    Err(format!(
        "the stitch's force is not a rise followed by a fall around its largest value of {peak:.1} N/m at {:.1} deg",
        top_angle.to_degrees()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GIVEN: Stitch = Stitch {
        angles: [0.06, 0.5, 0.75],
        peak: 880.0,
    };

    fn curve(to: f64) -> (Vec<f64>, Vec<f64>) {
        let g: Vec<f64> = (0..=400).map(|i| to * i as f64 / 400.0).collect();
        let f = g.iter().map(|g| GIVEN.force(*g)).collect();
        (g, f)
    }

    #[test]
    fn the_law_is_that_of_table_3_1() {
        for (g, f) in [
            (0.05, 0.0),
            (0.2, 280.0),
            (0.5, 880.0),
            (0.6, 528.0),
            (0.8, 0.0),
        ] {
            assert!((GIVEN.force(g) - f).abs() < 1e-9, "{g}");
        }
    }

    #[test]
    fn onset_peak_and_end_come_back_from_exact_points() {
        let (g, f) = curve(0.95);
        let fit = fit_stitch(&g, &f).unwrap();
        for (a, b) in fit.stitch.angles.iter().zip(GIVEN.angles) {
            assert!((a - b).abs() < 1e-8, "{fit:?}");
        }
        assert!(
            (fit.stitch.peak - 880.0).abs() < 1e-6 && fit.rms < 1e-6,
            "{fit:?}"
        );
    }

    #[test]
    fn a_stitch_that_carries_from_the_start_is_fitted_to_the_end() {
        // Force at 0 already: the onset would lie below 0, and stays at 0.
        let given = Stitch {
            angles: [-0.05, 0.5, 0.75],
            peak: 880.0,
        };
        let g: Vec<f64> = (1..=400).map(|i| 0.95 * f64::from(i) / 400.0).collect();
        let f: Vec<f64> = g.iter().map(|g| given.force(*g)).collect();
        let fit = fit_stitch(&g, &f).unwrap();
        assert_eq!(fit.stitch.angles[0], 0.0);
        let squares = |s: &Stitch| -> f64 {
            g.iter()
                .zip(&f)
                .map(|(g, f)| (f - s.force(*g)).powi(2))
                .sum()
        };
        let least = squares(&fit.stitch);
        // No other stitch with that onset fits better.
        for j in 1..4 {
            for by in [-1e-4, 1e-4] {
                let mut other = fit.stitch;
                if j < 3 {
                    other.angles[j] += by
                } else {
                    other.peak *= 1.0 + by
                }
                assert!(squares(&other) > least, "{j} {by}: {fit:?}");
            }
        }
    }

    #[test]
    fn slopes_are_the_differences_of_the_force() {
        for g in [0.2, 0.45, 0.55, 0.7] {
            let slopes = GIVEN.slopes(g);
            for j in 0..4 {
                let moved = |by: f64| {
                    let mut s = GIVEN;
                    if j < 3 {
                        s.angles[j] += by
                    } else {
                        s.peak += by
                    }
                    s.force(g)
                };
                let d = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                assert!(
                    (slopes[j] - d).abs() < 1e-3 * (1.0 + d.abs()),
                    "{g} {j} {} {d}",
                    slopes[j]
                );
            }
        }
    }

    #[test]
    fn data_that_end_before_the_failure_are_refused() {
        let (g, f) = curve(0.5);
        assert!(
            fit_stitch(&g, &f)
                .unwrap_err()
                .contains("before the stitch has failed")
        );
        let flat = vec![0.0; g.len()];
        assert!(fit_stitch(&g, &flat).unwrap_err().contains("no stitch"));
    }
}
