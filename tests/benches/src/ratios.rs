//! What the program takes over what a loop of a fixed number of operations takes in the same process and minute. The ratio of the two hardly
//! depends on the machine's clock, nor on who else uses it, so that a slowdown of the program shows on any machine.

use crate::cases::{self, Row};
use crate::{limits, machine, solver};
use serde_json::Value;
use std::collections::HashMap;

/// A slowdown from which on it is printed loudly.
const LOUD: f64 = 0.15;
/// Unit of the rows.
const UNIT: &str = "calibrations";

/// Ratios to be recorded: kernels, a strip, a press, a bag, and a look at steps that are done.
pub fn ratios() -> Vec<Row> {
    measured(2)
}

/// The same, with so many runs of each.
fn measured(times: usize) -> Vec<Row> {
    let mut rows = cases::kernel_ratios();
    let of = |(case, ratio): (String, f64)| Row::new(format!("{case}, ratio"), ratio, UNIT);
    rows.extend(
        solver::short_runs(times, |work| over(work))
            .into_iter()
            .map(of),
    );
    let steps = 2_000;
    let no_op = cases::NoOp::of(steps);
    let ratio = over(&|| no_op.nanoseconds());
    rows.push(of((format!("no-op of {steps} steps fanned out"), ratio)));
    rows
}

/// What some work costs (ns) over what an operation of the calibrating loop costs before or after it (ns, the less of both).
fn over(work: &dyn Fn() -> f64) -> f64 {
    let before = limits::nanoseconds_per_operation();
    let cost = work();
    cost / before.min(limits::nanoseconds_per_operation())
}

/// Measures the ratios and prints each beside the last recorded one, of this kind of processor if there is one. Records nothing, and fails
/// nothing.
pub fn compare() {
    let recorded = last();
    println!(
        "{:<64} {:>10} {:>10}  change",
        "over a calibrating loop", "now", "recorded"
    );
    let mut slower = Vec::new();
    for row in measured(1) {
        let Some((before, commit)) = recorded.get(&row.case) else {
            println!("{:<64} {:>10.2} {:>10}", row.case, row.value, "-");
            continue;
        };
        let change = row.value / before - 1.0;
        println!(
            "{:<64} {:>10.2} {:>10.2}  {:+.0} % ({commit})",
            row.case,
            row.value,
            before,
            100.0 * change
        );
        if change > LOUD {
            slower.push((row.case, change));
        }
    }
    for (case, change) in &slower {
        println!(
            "SLOWER by {:.0} % than recorded: {case}. Measure it again on a quiet machine (target/release/plyflow-benches ratios), and \
             find the change that did it",
            100.0 * change
        );
    }
}

/// The last recorded value of each ratio, and its commit: of this class of machine, else of any.
fn last() -> HashMap<String, (f64, String)> {
    let own = machine::record_file(&machine::class());
    let folder = own.parent().expect("a folder of records");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "jsonl") && *path != own)
        .collect();
    files.sort();
    // What is read last counts.
    files.push(own);
    let text = files
        .iter()
        .map(|f| std::fs::read_to_string(f).unwrap_or_default());
    let mut found = HashMap::new();
    for row in text.collect::<String>().lines().filter_map(row_of) {
        found.insert(row.0, row.1);
    }
    found
}

fn row_of(line: &str) -> Option<(String, (f64, String))> {
    let row: Value = serde_json::from_str(line).ok()?;
    let word = |key: &str| row[key].as_str().map(str::to_owned);
    let value = row["value"].as_f64().filter(|_| row["unit"] == UNIT)?;
    Some((word("case")?, (value, word("commit").unwrap_or_default())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_rows_of_ratios_are_compared_with() {
        let row = r#"{"case":"m4, ratio","value":12.5,"unit":"calibrations","commit":"abc"}"#;
        assert_eq!(
            row_of(row),
            Some(("m4, ratio".into(), (12.5, "abc".into())))
        );
        assert_eq!(row_of(&row.replace("calibrations", "ns")), None);
        assert_eq!(row_of("no row"), None);
    }

    #[test]
    fn the_loop_takes_a_time_that_a_processor_can() {
        let ratio = over(&|| 7.0);
        // From many operations a cycle to an emulator: 1 ps to 1 us.
        assert!((7e-3..7e3).contains(&ratio), "{ratio}");
    }
}
