//! Tables that an artifact carries in its attributes, for every kind of artifact (`tables` in the data model).

use crate::plots::in_words;
use crate::units::{duration, number, shown};
use maud::{Markup, html};
use plyflow_model::artifact::{Cell, Column, Table};
use plyflow_model::job::NamedResult;
use plyflow_model::units::check_si;
use serde::Deserialize;
use serde_json::Value;

/// Rows of a table that are shown.
const ROWS: usize = 200;

/// A table as it is told; what is no cell is a text, as it is written.
fn read(value: &Value) -> serde_json::Result<Table> {
    let mut value = value.clone();
    let rows = value.get_mut("rows").and_then(Value::as_array_mut);
    let rows = rows.into_iter().flatten();
    for cell in rows.filter_map(Value::as_array_mut).flatten() {
        if let Value::Bool(_) | Value::Array(_) | Value::Object(_) = cell {
            *cell = Value::String(cell.to_string());
        }
    }
    Table::deserialize(value)
}

/// Takes the unit from columns whose unit is none of SI, and says so: in which unit their numbers are is not known then.
fn drop_odd_units(table: &mut Table) -> Vec<String> {
    let mut wrong = Vec::new();
    for column in table.columns.iter_mut().filter(|c| !c.unit.is_empty()) {
        if let Err(e) = check_si(&column.unit) {
            let (table, label) = (&table.name, &column.label);
            wrong.push(format!("table '{table}': column '{label}': {e}"));
            column.unit.clear();
        }
    }
    wrong
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

/// Draws the tables that the attributes of an artifact describe. What is wrong is said in `wrong`, one text each.
///
/// `results`: of the step, for columns of what was measured. `id` names the defect of a row of the table `defects`, as the rest of the page does.
pub(crate) fn drawn(
    attributes: &Value,
    results: &[NamedResult],
    id: &dyn Fn(usize) -> String,
    wrong: &mut Vec<String>,
) -> Vec<Markup> {
    let all = match &attributes["tables"] {
        Value::Null => return Vec::new(),
        Value::Array(all) => all,
        other => {
            let what = in_words(other);
            wrong.push(format!(
                "its attribute 'tables' is {what}; expected a list of tables"
            ));
            return Vec::new();
        }
    };
    let mut tables = Vec::new();
    for (i, value) in all.iter().enumerate() {
        match read(value) {
            Ok(mut given) => {
                wrong.extend(drop_odd_units(&mut given));
                tables.push(table(&given, results, id, wrong));
            }
            Err(e) => {
                let name = value["name"].as_str().unwrap_or_default();
                wrong.push(format!("table {} '{name}' of its attributes: {e}", i + 1));
            }
        }
    }
    tables
}

fn table(
    given: &Table,
    results: &[NamedResult],
    id: &dyn Fn(usize) -> String,
    wrong: &mut Vec<String>,
) -> Markup {
    let of = |text: String| format!("table '{}': {text}", given.name);
    let wide = given.columns.len();
    for (i, row) in given
        .rows
        .iter()
        .enumerate()
        .filter(|(_, r)| r.len() != wide)
    {
        let got = row.len();
        wrong.push(of(format!(
            "row {} has {got} cells; expected {wide}",
            i + 1
        )));
    }
    if given.rows.len() > ROWS {
        let all = given.rows.len();
        wrong.push(of(format!("the first {ROWS} of its {all} rows are shown")));
    }
    let numeric = |k: usize| {
        let measured = given.columns.get(k).is_some_and(|c| c.measured.is_some());
        measured
            || given
                .rows
                .iter()
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
    use serde_json::json;

    #[test]
    fn numbers_are_shown_in_the_units_of_the_trade_and_mistakes_are_told() {
        let about = json!({"tables": [
            {"name": "runs", "columns": [{"label": "run"}, {"label": "height", "unit": "m"}],
             "rows": [["a <b>", 0.0031], ["c", null], ["short"]]},
            {"name": "no columns"},
        ]});
        let mut wrong = Vec::new();
        let tables = drawn(&about, &[], &|i| i.to_string(), &mut wrong);
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
        assert!(drawn(&json!({"tables": 3}), &[], &|i| i.to_string(), &mut wrong).is_empty());
        assert!(wrong[2].contains("a number"), "{wrong:?}");
    }

    #[test]
    fn what_is_no_cell_is_shown_as_it_is_written() {
        let about = json!({"tables": [{"name": "t", "columns": [{"label": "a"}, {"label": "b"}], "rows": [[true, [1, "x"]]]},
            {"name": "odd", "columns": [{"label": "a"}], "rows": [3]}]});
        let mut wrong = Vec::new();
        let tables = drawn(&about, &[], &|i| i.to_string(), &mut wrong);
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
        let text = &drawn(&about, &[], &|i| i.to_string(), &mut wrong)[0].0;
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
        let text = &drawn(&about, &results, &|i| i.to_string(), &mut wrong)[0].0;
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
