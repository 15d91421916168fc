//! `results --front`: what the ways of a study cost, how wrong they are, and which are on the Pareto front.
//!
//! Errors come from the artifacts' results, costs from the records beside them: so the front is put together here and is in no
//! artifact ([decision 1](../../../docs/decisions/0001-artifacts-hold-what-is-reproducible.md)).

use super::table::{bytes, csv_text, number, table};
use crate::progress::duration_text;
use plyflow_report::{COUNTS, Measure, OfClass, TARGETS, Way, Ways, advice};
use serde_json::{Value, json};

/// One row for each way, SI, memory in bytes; `on_front.<error>` is `true` where nothing cheaper is as good by that error.
pub fn as_csv(ways: &Ways) -> String {
    let mut head: Vec<String> = [
        "comparison",
        "model",
        "way",
        "is_reference",
        "measured_by",
        "start_time",
        "cpu_seconds",
        "wall_seconds",
        "peak_memory",
        "cpu_share",
    ]
    .map(str::to_owned)
    .to_vec();
    head.extend(Measure::ALL.map(|m| m.result().to_owned()));
    head.extend(COUNTS.map(str::to_owned));
    head.extend(Measure::ALL.map(|m| format!("on_front.{}", m.result())));
    let mut out = head.join(",") + "\n";
    let value = |v: Option<f64>| v.map(|v| v.to_string()).unwrap_or_default();
    for w in &ways.list {
        let mut cells = vec![
            csv_text(&w.comparison),
            csv_text(&w.model),
            csv_text(&w.name),
            w.is_reference.to_string(),
            csv_text(&w.measured_by),
            value(w.start_time),
            w.cpu_seconds.to_string(),
            w.wall_seconds.to_string(),
            value(w.peak_memory),
            w.share.to_string(),
        ];
        cells.extend(w.errors.map(value));
        cells.extend([0, 1, 2, 3].map(|k| value(w.counts.map(|c| c[k]))));
        cells.extend(w.on_front.map(|on| on.to_string()));
        out += &(cells.join(",") + "\n");
    }
    out
}

/// Errors by the size of the defects, of one class.
fn of_class(c: &OfClass) -> Value {
    json!({"class": c.name, "defects": c.title, "pairs": c.pairs, "missed": c.missed, "false": c.wrong, "mean_error": c.mean, "total_error": c.total})
}

/// A list of objects with the columns of [`as_csv`]; `errors` and `on_front` by the name of the error; besides, the errors by size.
pub fn as_json(ways: &Ways) -> Value {
    let one = |w: &Way| {
        let by_name = |values: [Value; Measure::COUNT]| -> Value {
            let names = Measure::ALL.map(|m| m.result().to_owned());
            names.into_iter().zip(values).collect()
        };
        let counts: Value = (COUNTS.iter().enumerate())
            .map(|(k, name)| ((*name).to_owned(), json!(w.counts.map(|c| c[k]))))
            .collect();
        json!({
            "comparison": w.comparison, "model": w.model, "way": w.name, "is_reference": w.is_reference,
            "measured_by": w.measured_by, "start_time": w.start_time, "cpu_seconds": w.cpu_seconds, "wall_seconds": w.wall_seconds,
            "peak_memory": w.peak_memory, "cpu_share": w.share, "errors": by_name(w.errors.map(|e| json!(e))),
            "counts": counts, "on_front": by_name(w.on_front.map(|on| json!(on))),
            "by_size": w.classes.iter().map(of_class).collect::<Value>(),
        })
    };
    ways.list.iter().map(one).collect()
}

/// Errors for people, with what stands over their columns: behind each mean over defects its total.
const COLUMNS: [(Measure, &str); Measure::COUNT] = [
    (Measure::Defects, "defects"),
    (Measure::TotalDefects, "total"),
    (Measure::Length, "length"),
    (Measure::TotalLength, "total"),
    (Measure::Amplitude, "amplitude"),
    (Measure::TotalAmplitude, "total"),
    (Measure::BridgingArea, "bridging"),
    (Measure::TotalBridgingArea, "total"),
    (Measure::Position, "position"),
    (Measure::Distance, "distance"),
    (Measure::Shear, "shear"),
];

/// An error of a way, with a star behind it where nothing cheaper has it or is below.
fn error(w: &Way, m: Measure) -> String {
    let Some(e) = w.error(m) else {
        return String::new();
    };
    let text = match m.unit() {
        "m" => format!("{:.3} mm", 1e3 * e),
        "rad" => format!("{:.2} deg", e.to_degrees()),
        _ => format!("{:.1} %", 100.0 * e),
    };
    format!("{text}{}", if w.is_on_front(m) { " *" } else { "  " })
}

/// The ways of one reference, and the cheapest of them for some errors. Errors that no way has get no column.
fn of_one_reference(ways: &Ways) -> String {
    let known = |m: Measure| ways.list.iter().any(|w| w.error(m).is_some());
    let columns = || COLUMNS.into_iter().filter(|(m, _)| known(*m));
    let costs = ["way", "cpu", "wall, added up", "memory", "share"];
    let head: Vec<&str> = costs.into_iter().chain(columns().map(|c| c.1)).collect();
    let line = |w: &Way| {
        let mut cells = vec![
            w.label(),
            duration_text(w.cpu_seconds),
            duration_text(w.wall_seconds),
            w.peak_memory.map_or(String::new(), |m| bytes(m as u64)),
            format!("{} %", number((1e4 * w.share).round() / 100.0)),
        ];
        cells.extend(columns().map(|(m, _)| error(w, m)));
        cells
    };
    let lines: Vec<Vec<String>> = ways.list.iter().map(line).collect();
    let right: Vec<usize> = (1..head.len()).collect();
    let told = advice(ways, &TARGETS);
    let told: String = told.iter().map(|text| format!("{text}\n")).collect();
    format!("{}\n{told}\n", table(&head, &lines, &right))
}

/// For people, with the cheapest way for some errors.
pub fn as_table(ways: &Ways) -> String {
    if ways.list.is_empty() {
        return "no comparison has run (among the steps chosen) that measures one way by another\n"
            .to_owned();
    }
    let groups = ways.by_reference();
    let mut text = String::new();
    for (of, ways) in &groups {
        if groups.len() > 1 {
            text += &format!("By the reference of {of}:\n");
        }
        text += &of_one_reference(ways);
    }
    text + &format!(
        "Errors against the {}: means over defects, and beside them totals, in which each counts by its size. *: nothing cheaper is as good.\n",
        ways.yardstick()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(model: &str, cpu: f64, error: Option<f64>, on_front: bool) -> Way {
        Way {
            comparison: "comparison".into(),
            model: model.into(),
            name: format!("{model}, alone"),
            cpu_seconds: cpu,
            wall_seconds: 0.5 * cpu,
            peak_memory: None,
            share: cpu / 40.0,
            errors: by_measure([
                (Measure::Defects, error),
                (Measure::Position, Some(0.002)),
                (Measure::Shear, Some(0.01)),
                (Measure::TotalLength, Some(0.0634)),
            ]),
            counts: Some([1.0, 0.0, 2.0, 0.0]),
            classes: vec![OfClass {
                title: "wrinkles below 20 mm".into(),
                name: "wrinkle.short".into(),
                pairs: 4.0,
                missed: 1.0,
                wrong: 0.0,
                mean: Some(0.3),
                total: None,
            }],
            is_reference: false,
            measured_by: "comparison".into(),
            start_time: None,
            on_front: by_measure([
                (Measure::Defects, on_front),
                (Measure::Position, true),
                (Measure::TotalLength, on_front),
            ]),
        }
    }

    fn by_measure<T: Copy + Default, const N: usize>(
        told: [(Measure, T); N],
    ) -> [T; Measure::COUNT] {
        let of = |m| told.iter().find(|t| t.0 == m);
        Measure::ALL.map(|m| of(m).map_or(T::default(), |t| t.1))
    }

    fn ways() -> Ways {
        let late = Way {
            start_time: Some(0.6),
            counts: None,
            ..way("other.late", 20.0, None, false)
        };
        Ways {
            list: vec![way("global", 10.0, Some(0.8), true), late],
            of_the_whole: true,
        }
    }

    #[test]
    fn a_row_of_csv_has_costs_errors_counts_and_fronts_under_their_names() {
        let text = as_csv(&ways());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        let head: Vec<&str> = lines[0].split(',').collect();
        // The only comma within a cell is that of the name.
        let cells = |line: &str| -> Vec<String> {
            let line = line.replace(", alone", "; alone");
            line.split(',').map(str::to_owned).collect()
        };
        let cell = |row: usize, name: &str| {
            let k = head.iter().position(|h| *h == name).expect(name);
            cells(lines[row])[k].clone()
        };
        for row in [1, 2] {
            assert_eq!(cells(lines[row]).len(), head.len());
        }
        assert_eq!(cell(1, "way"), "\"global; alone\"");
        let told = [
            ("cpu_seconds", "10"),
            ("cpu_share", "0.25"),
            ("defect_error", "0.8"),
            ("position_error", "0.002"),
            ("wrinkle_length_error", ""),
            ("missed_bridging", "2"),
            ("on_front.defect_error", "true"),
            ("on_front.distance_error", "false"),
            ("wrinkle_length_total_error", "0.0634"),
            ("on_front.wrinkle_length_total_error", "true"),
            ("defect_total_error", ""),
            ("start_time", ""),
        ];
        for (name, value) in told {
            assert_eq!(cell(1, name), value, "{name}");
        }
        assert_eq!(
            (cell(2, "start_time"), cell(2, "missed_bridging")),
            ("0.6".into(), String::new())
        );
    }

    #[test]
    fn json_and_the_table_tell_the_same() {
        let list = as_json(&ways());
        assert_eq!(list[0]["errors"]["defect_error"], 0.8);
        assert_eq!(list[0]["on_front"]["defect_error"], true);
        assert_eq!(list[0]["counts"]["missed_wrinkles"], 1.0);
        assert_eq!(list[1]["errors"]["defect_error"], Value::Null);
        let class = &list[0]["by_size"][0];
        assert_eq!(class["class"], "wrinkle.short");
        let told = ["pairs", "missed", "false", "mean_error", "total_error"].map(|k| &class[k]);
        let expected = [json!(4.0), json!(1.0), json!(0.0), json!(0.3), Value::Null];
        assert_eq!(told, expected.each_ref());
        let text = as_table(&ways());
        for part in [
            "80.0 % *",
            "2.000 mm *",
            "0.57 deg\n",
            "6.3 % *",
            "other.late, alone (from 0.60 s)",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(as_table(&Ways::default()).contains("no comparison has run"));
    }
}
