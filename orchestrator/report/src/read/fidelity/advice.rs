//! Which way is the cheapest for an error, by the mean over defects and in total.

use super::measure::Measure;
use super::way::{Way, Ways};

/// Errors for which the cheapest way is told.
pub const TARGETS: [f64; 3] = [0.2, 0.1, 0.05];

/// For each of the errors: the cheapest way with no more, if it is not the reference alone, by the mean over defects and in total. Of one reference's
/// ways.
#[must_use]
pub fn advice(ways: &Ways, targets: &[f64]) -> Vec<String> {
    targets.iter().filter_map(|t| one(ways, *t)).collect()
}

/// The cheapest way whose error is no more; without any, the reference, also one that began late.
fn cheapest(ways: &Ways, measure: Measure, target: f64) -> Option<&Way> {
    let good = |w: &&Way| w.error(measure).is_some_and(|e| e <= target);
    let found = ways.list.iter().find(|w| w.is_whole() && good(w));
    found.or(ways.list.iter().find(|w| w.is_reference && good(w)))
}

fn one(ways: &Ways, target: f64) -> Option<String> {
    let [mean, total] =
        [Measure::Defects, Measure::TotalDefects].map(|m| cheapest(ways, m, target));
    let sentence = |what: &str, way: &Way| {
        let (percent, yardstick) = (100.0 * target, ways.yardstick());
        let what = format!("For {what} of {percent:.0} % or less");
        if way.is_reference {
            return format!("{what} there is none but the {yardstick}.");
        }
        let (name, share) = (&way.name, 100.0 * way.share);
        format!("{what}: {name} ({share:.1} % of the CPU time of the {yardstick}).")
    };
    Some(match (mean?, total) {
        // Comparisons of before there were totals.
        (way, None) => sentence("an error", way),
        (way, Some(same)) if std::ptr::eq(way, same) => sentence("a mean and a total error", way),
        (by_mean, Some(by_total)) => format!(
            "{} {} The two measures name different ways.",
            sentence("a mean error", by_mean),
            sentence("a total error", by_total)
        ),
    })
}
