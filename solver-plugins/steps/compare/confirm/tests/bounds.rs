//! Bounds of sizes whose limit is known.

use plyflow_confirm::{Bounds, Measured, bounds};
use std::f64::consts::SQRT_2;

const LIMIT: f64 = 0.046;

/// A size that converges to the limit with an order, over three element sizes.
fn converging(order: f64, rate: f64) -> Vec<[f64; 2]> {
    let sizes = [0.004, 0.004 / SQRT_2, 0.002];
    sizes.map(|h| [h, LIMIT + rate * h.powf(order)]).to_vec()
}

fn of(by_elements: &[[f64; 2]], others: &[f64]) -> Bounds {
    bounds(&Measured {
        by_elements: by_elements.to_vec(),
        others: others.to_vec(),
        shared: 0.0,
    })
}

#[test]
fn what_all_runs_share_counts_beside_what_they_differ_by() {
    let found = bounds(&Measured {
        by_elements: vec![[0.004, 0.050]],
        others: vec![0.053],
        shared: 0.08,
    });
    // 8 % of 50 mm are 4 mm; with 3 mm beside them 5 mm.
    assert!((found.low - 0.046).abs() < 1e-12, "{found:?}");
    assert!((found.high - 0.055).abs() < 1e-12, "{found:?}");
}

#[test]
fn the_limit_lies_within_the_bounds_of_two_element_sizes_whatever_the_order_is() {
    for order in [1.0, 1.3, 2.0] {
        for rate in [-1.0, 1.0] {
            let runs = converging(order, rate);
            let found = of(&runs[..2], &[]);
            // The lowest order gives the limit of one that converges with it exactly.
            assert!(
                found.low <= LIMIT + 1e-12 && LIMIT - 1e-12 <= found.high,
                "{order} {rate}: {found:?}"
            );
            assert_eq!(found.order, None);
            assert!(
                runs[..2]
                    .iter()
                    .all(|r| found.low <= r[1] && r[1] <= found.high)
            );
        }
    }
}

#[test]
fn two_sizes_leave_the_error_of_the_lowest_order() {
    let found = of(&[[0.004, 0.050], [0.002, 0.047]], &[]);
    // The finest and, to either side, the difference over (2 - 1): 44 to 50 mm.
    assert!(
        (found.low - 0.044).abs() < 1e-12 && (found.high - 0.050).abs() < 1e-12,
        "{found:?}"
    );
}

#[test]
fn over_three_element_sizes_the_order_is_observed_and_narrows_the_bounds() {
    for order in [1.0, 1.5, 2.0] {
        let runs = converging(order, 20.0);
        let found = of(&runs, &[]);
        assert!(
            (found.order.unwrap() - order).abs() < 1e-6,
            "{order}: {found:?}"
        );
        // Roache's factor of safety: 1.25 times the error of the finest.
        let error = runs[2][1] - LIMIT;
        assert!(
            (runs[2][1] - found.low - 1.25 * error).abs() < 1e-9,
            "{order}: {found:?}"
        );
    }
    let runs = converging(2.0, 20.0);
    let width = |b: Bounds| b.high - b.low;
    assert!(width(of(&runs, &[])) < width(of(&runs[..2], &[])));
}

#[test]
fn an_order_beyond_what_is_believed_is_kept_within_it_and_none_is_seen_in_scatter() {
    assert_eq!(
        of(&converging(3.0, 5000.0), &[])
            .order
            .map(|p| (p * 1e6).round() / 1e6),
        Some(2.0)
    );
    let scatter = of(&[[0.004, 0.046], [0.003, 0.048], [0.002, 0.047]], &[]);
    assert_eq!(scatter.order, None);
    // The larger of both differences, with the lowest order: 2 mm / (4/3 - 1).
    assert!(
        (scatter.high - 0.053).abs() < 1e-12 && (scatter.low - 0.041).abs() < 1e-12,
        "{scatter:?}"
    );
}

#[test]
fn changes_of_other_variants_add_up_as_squares_to_the_side_to_which_they_go() {
    // 3 and 4 mm up, 1 mm down.
    let found = of(&[[0.004, 0.046]], &[0.049, 0.050, 0.045]);
    assert!(
        (found.high - 0.051).abs() < 1e-12 && (found.low - 0.045).abs() < 1e-12,
        "{found:?}"
    );
    let alone = of(&[[0.004, 0.046]], &[]);
    assert_eq!((alone.low, alone.high), (0.046, 0.046));
    // No size is below zero.
    assert_eq!(of(&[[0.004, 0.002], [0.002, 0.0005]], &[]).low, 0.0);
}
