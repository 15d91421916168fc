//! Linear least squares by QR, with the condition of what was solved.

use nalgebra::{DMatrix, DVector};
use plyflow_fixed::FixedBits;

/// Below this ratio of singular values the unknowns are not determined.
const RANK: f64 = 1e-12;

/// Solution of a least-squares problem.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Unknowns.
    pub unknowns: Vec<f64>,
    /// Root mean square of the residuals.
    pub rms: f64,
    /// Largest over smallest singular value of the matrix with columns of length 1: how much relative
    /// errors may grow.
    pub condition: f64,
    /// Independent directions of the unknowns' uncertainty, `[columns]` vectors `v_j`, the best determined
    /// first: `sum v_j v_j^T = (A^T A)^-1`, so times the deviation of the data they span its error ellipsoid.
    pub spread: Vec<Vec<f64>>,
}

/// Minimises `|A x - b|`; `matrix` is `[rows][columns]`, with at least as many rows as columns.
///
/// # Errors
/// When there are too few rows or the columns do not determine the unknowns.
pub fn least_squares(matrix: &DMatrix<f64>, right: &[f64]) -> Result<Solution, String> {
    let (rows, columns) = matrix.shape();
    if rows < columns || columns == 0 || right.len() != rows {
        return Err(format!(
            "{rows} equations do not determine {columns} unknowns"
        ));
    }
    let lengths: Vec<f64> = (0..columns).map(|j| matrix.column(j).norm()).collect();
    let undetermined =
        || format!("the data do not determine all {columns} unknowns of the fit; take fewer");
    if lengths.iter().any(|l| !l.is_finite() || *l <= 0.0) {
        return Err(undetermined());
    }
    let mut scaled = matrix.clone();
    for (j, l) in lengths.iter().enumerate() {
        scaled.column_mut(j).unscale_mut(*l);
    }
    let qr = scaled.qr();
    let mut projected = DVector::from_column_slice(right);
    qr.q_tr_mul(&mut projected);
    let r = qr.r();
    let svd = r.clone().svd(false, true);
    let axes = svd.v_t.as_ref().ok_or_else(undetermined)?;
    let singular = &svd.singular_values;
    let (largest, smallest) = (singular.max(), singular.min());
    if smallest.is_nan() || smallest <= RANK * largest {
        return Err(undetermined());
    }
    let top = projected.rows(0, columns).into_owned();
    let y = r.solve_upper_triangular(&top).ok_or_else(undetermined)?;
    let unknowns: Vec<f64> = (0..columns).map(|j| y[j] / lengths[j]).collect();
    let spread = (0..columns)
        .map(|j| {
            (0..columns)
                .map(|i| axes[(j, i)] / (singular[j] * lengths[i]))
                .collect()
        })
        .collect();
    let left: f64 = projected
        .rows(columns, rows - columns)
        .iter()
        .map(|v| v * v)
        .sum();
    Ok(Solution {
        unknowns,
        rms: (left / rows as f64).sqrt(),
        condition: largest / smallest,
        spread,
    })
}

/// Largest over smallest singular value.
pub fn condition(matrix: &DMatrix<f64>) -> f64 {
    let singular = matrix.clone().qr().r().singular_values();
    let (largest, smallest) = (singular.max(), singular.min());
    largest / smallest.max(largest * f64::EPSILON).max(f64::MIN_POSITIVE)
}

/// A polynomial `sum c_n x^n`.
#[derive(Debug, Clone, PartialEq)]
pub struct Polynomial {
    /// Coefficients of `x^0`, `x^1`, ...
    pub coefficients: Vec<f64>,
}

impl Polynomial {
    /// Its value.
    pub fn value(&self, x: f64) -> f64 {
        self.coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, c| sum * x + c)
    }

    /// Value of the odd extension: `-p(-x)` for negative `x`.
    pub fn odd(&self, x: f64) -> f64 {
        if x < 0.0 {
            -self.value(-x)
        } else {
            self.value(x)
        }
    }
}

/// Fits `y = c_1 x + ... + c_degree x^degree` (zero constant term).
///
/// # Errors
/// As [`least_squares`].
pub fn fit_polynomial(
    x: &[f64],
    y: &[f64],
    degree: usize,
) -> Result<(Polynomial, Solution), String> {
    let scale = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    if scale <= 0.0 {
        return Err("all abscissas are zero".into());
    }
    let matrix = DMatrix::from_fn(x.len(), degree, |i, j| (x[i] / scale).powi(j as i32 + 1));
    let solution = least_squares(&matrix, y)?;
    let mut coefficients = vec![0.0];
    for (j, c) in solution.unknowns.iter().enumerate() {
        coefficients.push(c / scale.powi(j as i32 + 1));
    }
    Ok((Polynomial { coefficients }, solution))
}

/// Bayesian information criterion of a fit with `unknowns` to `rows` data of root mean square residual
/// `rms`: the smaller the better. Residuals below `floor` count as `floor`.
pub fn bayes_criterion(rms: f64, floor: f64, rows: usize, unknowns: usize) -> f64 {
    let n = rows as f64;
    n * (rms * rms + floor * floor).fixed_ln() + unknowns as f64 * n.fixed_ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_through_four_points_is_that_of_the_normal_equations() {
        // x = 0..3, y = 1 + 2 x + (1, -1, -1, 1): a residual orthogonal to 1 and x.
        let matrix = DMatrix::from_fn(4, 2, |i, j| if j == 0 { 1.0 } else { i as f64 });
        let s = least_squares(&matrix, &[2.0, 2.0, 4.0, 8.0]).unwrap();
        assert!((s.unknowns[0] - 1.0).abs() < 1e-13 && (s.unknowns[1] - 2.0).abs() < 1e-13);
        assert!((s.rms - 1.0).abs() < 1e-13);
        // (A^T A)^-1 of sums 4, 6, 14: determinant 20.
        let expected = [14.0 / 20.0, -6.0 / 20.0, -6.0 / 20.0, 4.0 / 20.0];
        for (k, e) in expected.iter().enumerate() {
            let sum: f64 = s.spread.iter().map(|v| v[k / 2] * v[k % 2]).sum();
            assert!((sum - e).abs() < 1e-13, "{:?}", s.spread);
        }
    }

    #[test]
    fn undetermined_unknowns_are_refused() {
        let matrix = DMatrix::from_fn(4, 2, |i, _| i as f64 + 1.0);
        assert!(least_squares(&matrix, &[1.0; 4]).is_err());
        assert!(least_squares(&DMatrix::from_element(1, 2, 1.0), &[1.0]).is_err());
        assert!(fit_polynomial(&[0.0; 5], &[0.0; 5], 2).is_err());
    }

    #[test]
    fn a_polynomial_gives_its_coefficients_back() {
        let given = Polynomial {
            coefficients: vec![
                0.0, 37.35, -322.61, 1458.51, -3539.56, 4727.84, -3275.2, 930.53,
            ],
        };
        let x: Vec<f64> = (1..200).map(|i| i as f64 * 0.0055).collect();
        let y: Vec<f64> = x.iter().map(|x| given.value(*x)).collect();
        let (found, solution) = fit_polynomial(&x, &y, 7).unwrap();
        for (a, b) in found.coefficients.iter().zip(&given.coefficients) {
            assert!((a - b).abs() <= 1e-8 * b.abs(), "{a} {b}");
        }
        assert!(solution.condition > 1e3, "{}", solution.condition);
        assert_eq!(found.odd(-0.3), -found.value(0.3));
    }
}
