//! What a step that has ended tells in its line.

use plyflow_model::job::{NamedResult, Record};

/// Results that say most of a step, the more telling first.
const MAIN: [&str; 12] = [
    "zone_count",
    "wrinkle_count",
    "bridging_count",
    "defect_count",
    "shear_max",
    "shear_min",
    "distance_max",
    "flagged_area",
    "coverage",
    "draw_in_max",
    "kinetic_ratio",
    "drift_ratio",
];

/// Most results in a line.
const MOST: usize = 4;

/// The main results of a step, as the rest of a line: `: shear_max 41.3 deg, kinetic_ratio 0.012`. Empty for one without any.
pub fn main_results(record: &Record) -> String {
    let named = |name: &&str| record.results.iter().find(|r| r.name == **name);
    let found: Vec<String> = MAIN.iter().filter_map(named).take(MOST).map(one).collect();
    match found.is_empty() {
        true => String::new(),
        false => format!(": {}", found.join(", ")),
    }
}

fn one(result: &NamedResult) -> String {
    let (value, unit) = match result.unit.as_str() {
        "rad" => (result.value.to_degrees(), " deg"),
        "m" => (1e3 * result.value, " mm"),
        "m2" => (1e4 * result.value, " cm2"),
        "1" | "" => (result.value, ""),
        other => return format!("{} {} {other}", result.name, three(result.value)),
    };
    format!("{} {}{unit}", result.name, three(value))
}

/// A number to three figures.
fn three(value: f64) -> String {
    let size = value.abs().log10().floor();
    if value == 0.0 || !(-4.0..6.0).contains(&size) {
        return if value == 0.0 {
            "0".into()
        } else {
            format!("{value:.2e}")
        };
    }
    let digits = (2.0 - size).max(0.0) as usize;
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn record(results: &[(&str, f64, &str)]) -> Record {
        let results: Vec<_> = results
            .iter()
            .map(|(name, value, unit)| json!({"name": name, "value": value, "unit": unit}))
            .collect();
        serde_json::from_value(json!({
            "version": 1, "step": "s", "item": [], "key": "", "kind": "forming", "bytes": 0, "results": results, "host": "", "started": 0.0,
            "cost": {"wall_seconds": 1.0, "cpu_seconds": 1.0, "threads": 1, "peak_memory": 0},
        }))
        .unwrap_or_else(|e| panic!("{e}"))
    }

    #[test]
    fn the_line_of_a_step_has_its_main_results_in_units_of_the_workshop() {
        let all = [
            ("kinetic_ratio", 0.012_345, "1"),
            ("cycles", 1e5, "1"),
            ("shear_max", 0.75, "rad"),
            ("distance_max", 0.001_23, "m"),
            ("flagged_area", 0.0025, "m2"),
            ("shear_min", -0.5, "rad"),
        ];
        let expected =
            ": shear_max 43 deg, shear_min -28.6 deg, distance_max 1.23 mm, flagged_area 25 cm2";
        assert_eq!(main_results(&record(&all)), expected);
        let few = [("elements", 5.0, "1"), ("zone_count", 0.0, "1")];
        assert_eq!(main_results(&record(&few)), ": zone_count 0");
        assert_eq!(main_results(&record(&[("cycles", 5.0, "1")])), "");
    }
}
