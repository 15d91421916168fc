//! Tables that steps carry.

use crate::read::ROWS;
use crate::units::{duration, number, shown};
use maud::{Markup, html};
use plyflow_model::artifact::{Cell, Column, Table};
use plyflow_model::job::NamedResult;

/// A table. `results`: of the step, for columns of what was measured. `id` names the defect of a row of the table `defects`, as the rest of
/// the page does.
pub(super) fn table(
    given: &Table,
    results: &[NamedResult],
    id: &dyn Fn(usize) -> String,
) -> Markup {
    let numeric = |k: usize| {
        let measured = given.columns.get(k).is_some_and(|c| c.measured.is_some());
        measured
            || (given.rows.iter())
                .any(|r| matches!(r.get(k), Some(Cell::Count(_) | Cell::Number(_))))
    };
    let class = |k: usize| if numeric(k) { "n" } else { "" };
    html! {
        p class="plot-title" { (given.title.as_deref().unwrap_or(&given.name)) }
        div class="scroll" { table {
            thead { tr { @for (k, c) in given.columns.iter().enumerate() { th class=(class(k)) { (heading(c)) } } } }
            tbody { @for (i, row) in given.rows.iter().enumerate().take(ROWS) { tr data-defect=[(given.name == "defects").then(|| id(i))] {
                @for (k, (c, v)) in given.columns.iter().zip(row).enumerate() { td class=(class(k)) { (cell(c, v, result(c, row, results))) } }
            } } }
        } }
    }
}

/// The result that a row has in a column of what was measured.
fn result<'a>(
    column: &Column,
    row: &[Cell],
    results: &'a [NamedResult],
) -> Option<&'a NamedResult> {
    let mut name = column.measured.clone()?;
    for (k, cell) in row.iter().enumerate() {
        let place = format!("{{{k}}}");
        if name.contains(&place) {
            let Cell::Text(text) = cell else {
                return None;
            };
            name = name.replace(&place, text);
        }
    }
    results.iter().find(|r| r.name == name)
}

fn heading(c: &Column) -> String {
    match shown(&c.unit).1 {
        // Durations are told each in its own unit.
        "s" if c.measured.is_some() => c.label.clone(),
        "" => c.label.clone(),
        unit => format!("{} ({unit})", c.label),
    }
}

fn cell(c: &Column, value: &Cell, measured: Option<&NamedResult>) -> String {
    if let Some(result) = measured {
        return match result.unit.as_str() {
            "s" => duration(result.value),
            unit => number(result.value * shown(unit).0, 4),
        };
    }
    let told = |v: f64| number(v * shown(&c.unit).0, 4);
    match value {
        Cell::Empty => "–".to_owned(),
        Cell::Text(text) => text.clone(),
        Cell::Count(n) => told(*n as f64),
        Cell::Number(v) => told(*v),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::tables::read;
    use serde_json::{Value, json};

    fn drawn(about: &Value, results: &[NamedResult], wrong: &mut Vec<String>) -> Vec<Markup> {
        let id = |i: usize| i.to_string();
        let all = read(about, wrong);
        all.iter().map(|t| table(t, results, &id)).collect()
    }

    #[test]
    fn numbers_are_shown_in_the_units_of_the_trade_and_mistakes_are_told() {
        let about = json!({"tables": [
            {"name": "runs", "columns": [{"label": "run"}, {"label": "height", "unit": "m"}],
             "rows": [["a <b>", 0.0031], ["c", null], ["short"]]},
            {"name": "no columns"},
        ]});
        let mut wrong = Vec::new();
        let tables = drawn(&about, &[], &mut wrong);
        let text = &tables[0].0;
        for part in ["height (mm)", ">3.1<", "a &lt;b&gt;", ">–<"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert_eq!(wrong.len(), 2);
        assert!(
            wrong[0].contains("row 3 has 1 cells; expected 2"),
            "{wrong:?}"
        );
        assert!(
            wrong[1].contains("'no columns'") && wrong[1].contains("columns"),
            "{wrong:?}"
        );
        assert!(drawn(&json!({"tables": 3}), &[], &mut wrong).is_empty());
        assert!(wrong[2].contains("a number"), "{wrong:?}");
    }

    #[test]
    fn what_is_no_cell_is_shown_as_it_is_written() {
        let about = json!({"tables": [{"name": "t", "columns": [{"label": "a"}, {"label": "b"}], "rows": [[true, [1, "x"]]]},
            {"name": "odd", "columns": [{"label": "a"}], "rows": [3]}]});
        let mut wrong = Vec::new();
        let tables = drawn(&about, &[], &mut wrong);
        let text = &tables[0].0;
        assert!(
            text.contains(">true<") && text.contains(">[1,&quot;x&quot;]<"),
            "{text}"
        );
        assert_eq!((tables.len(), wrong.len()), (1, 1), "{wrong:?}");
        assert!(wrong[0].contains("table 2 'odd'"), "{wrong:?}");
    }

    #[test]
    fn a_column_in_a_unit_that_is_none_of_si_is_told_and_shown_without_it() {
        let about = json!({"tables": [{"name": "runs", "rows": [[0.0031, 0.0031, 2.0]], "columns": [
            {"label": "height", "unit": "mm"}, {"label": "depth", "unit": "m"}, {"label": "way", "unit": "furlong"}]}]});
        let mut wrong = Vec::new();
        let text = &drawn(&about, &[], &mut wrong)[0].0;
        for part in [">height<", ">0.0031<", ">depth (mm)<", ">3.1<", ">way<"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert_eq!(wrong.len(), 2, "{wrong:?}");
        assert!(
            wrong[0].contains("column 'height': 1 `mm` is 0.001 in SI"),
            "{wrong:?}"
        );
    }

    #[test]
    fn what_was_measured_is_taken_from_the_results_of_the_step_by_the_texts_of_its_row() {
        let about = json!({"tables": [{"name": "runs", "rows": [["a", "Z", null], ["b", null, null]], "columns": [
            {"label": "run"}, {"label": "zone"},
            {"label": "CPU", "unit": "s", "measured": "cost.{0}.{1}.cpu_seconds"}]}]});
        let result = |name: &str, value: f64| NamedResult {
            name: name.into(),
            value,
            unit: "s".into(),
            measured: true,
        };
        let results = [
            result("cost.a.Z.cpu_seconds", 75.0),
            result("cost.b.Z.cpu_seconds", 1.0),
        ];
        let mut wrong = Vec::new();
        let text = &drawn(&about, &results, &mut wrong)[0].0;
        assert!(text.contains("<th class=\"n\">CPU</th>"), "{text}");
        assert!(text.contains(">1 min 15 s<"), "{text}");
        // A row without a zone has none of its own.
        assert!(
            text.ends_with("<td class=\"n\">–</td></tr></tbody></table></div>"),
            "{text}"
        );
        assert!(wrong.is_empty(), "{wrong:?}");
    }
}
