//! Distributions of a quantity over a surface: every value counts by its weight (the area that it stands for).

use plyflow_fixed::FixedBits;

/// The quantiles `shares` (0 to 1) of `values` by weight: for each share q the least value that values of at least the
/// share q of the whole weight do not exceed. All 0 without weight.
///
/// # Panics
/// When there are not as many weights as values.
pub fn weighted_quantiles(values: &[f64], weights: &[f64], shares: &[f64]) -> Vec<f64> {
    assert_eq!(values.len(), weights.len(), "one weight per value");
    let mut order: Vec<usize> = (0..values.len()).filter(|i| weights[*i] > 0.0).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut reached = Vec::with_capacity(order.len());
    let mut sum = 0.0;
    for i in &order {
        sum += weights[*i];
        reached.push(sum);
    }
    let of = |share: &f64| {
        // A hair less, so that the rounding of the sums does not skip a value.
        let at = reached.partition_point(|s| *s < share * sum * (1.0 - 1e-12));
        order
            .get(at.min(order.len().saturating_sub(1)))
            .map_or(0.0, |i| values[*i])
    };
    shares.iter().map(of).collect()
}

/// The mean of `values` by weight; 0 without weight.
///
/// # Panics
/// When there are not as many weights as values.
pub fn weighted_mean(values: &[f64], weights: &[f64]) -> f64 {
    assert_eq!(values.len(), weights.len(), "one weight per value");
    let whole: f64 = weights.iter().sum();
    let sum: f64 = values.iter().zip(weights).map(|(v, w)| v * w).sum();
    if whole > 0.0 { sum / whole } else { 0.0 }
}

/// A width of bins of 1, 2 or 5 times a power of ten, with 40 to 100 of them up to `range`.
pub fn bin_width(range: f64) -> f64 {
    let least = range.max(1e-12) / 100.0;
    let power = 10f64.fixed_powf(least.fixed_log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0];
    let step = step.into_iter().find(|s| s * power >= least * (1.0 - 1e-9));
    step.unwrap_or(10.0) * power
}

/// The probability density of `values` by weight in `count` bins of `width` from 0 on: the share of the whole weight
/// that lies in the bin, over its width. Values beyond the bins are part of the whole, so that the integral over the bins
/// is the share of what lies in them.
///
/// # Panics
/// When there are not as many weights as values.
pub fn density(values: &[f64], weights: &[f64], width: f64, count: usize) -> Vec<f64> {
    assert_eq!(values.len(), weights.len(), "one weight per value");
    let whole: f64 = weights.iter().sum();
    let mut bins = vec![0.0; count];
    for (v, w) in values.iter().zip(weights).filter(|(v, _)| **v >= 0.0) {
        if let Some(bin) = bins.get_mut((v / width) as usize) {
            *bin += w;
        }
    }
    let scale = if whole > 0.0 {
        1.0 / (whole * width)
    } else {
        0.0
    };
    bins.iter().map(|b| b * scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_mean_count_by_weight() {
        let (values, weights) = ([3.0, 1.0, 2.0, 9.0], [1.0, 1.0, 2.0, 0.0]);
        let q = weighted_quantiles(&values, &weights, &[0.0, 0.25, 0.26, 0.75, 0.76, 1.0]);
        assert_eq!(q, [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
        assert_eq!(weighted_mean(&values, &weights), 2.0);
        assert_eq!(weighted_quantiles(&[], &[], &[0.5]), [0.0]);
        assert_eq!(weighted_mean(&[], &[]), 0.0);
    }

    #[test]
    fn a_density_integrates_to_the_share_inside_of_its_bins() {
        // Evenly between 0 and 1: a density of 1; a tenth of the weight lies beyond the bins.
        let values: Vec<f64> = (0..1000).map(|i| (f64::from(i) + 0.5) / 1000.0).collect();
        let d = density(&values, &vec![0.3; 1000], 0.05, 18);
        assert!(d.iter().all(|d| (d - 1.0).abs() < 1e-9), "{d:?}");
        assert!((d.iter().sum::<f64>() * 0.05 - 0.9).abs() < 1e-9);
        assert_eq!(density(&[], &[], 0.1, 2), [0.0, 0.0]);
    }

    #[test]
    fn widths_of_bins_are_round() {
        let near = |range: f64, width: f64| (bin_width(range) - width).abs() < 1e-9 * width;
        assert!(near(1.0, 0.01) && near(1.01, 0.02) && near(6.6, 0.1) && near(3e-4, 5e-6));
        for i in 0..300 {
            let range = 1e-3 * 1.05f64.powi(i);
            let count = range / bin_width(range);
            assert!((39.9..100.1).contains(&count), "{range}: {count}");
        }
    }
}
