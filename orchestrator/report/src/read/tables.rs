//! Tables that an artifact carries in its attributes, for every kind of artifact (`tables` in the data model).

use crate::read::carried::{list, unreadable};
use plyflow_model::artifact::Table;
use plyflow_model::units::check_si;
use serde::Deserialize;
use serde_json::Value;

/// Rows of a table that are shown.
pub(crate) const ROWS: usize = 200;

/// Reads the tables that the attributes of an artifact describe. What is wrong is said in `wrong`, one text each.
pub(crate) fn read(attributes: &Value, wrong: &mut Vec<String>) -> Vec<Table> {
    let mut tables = Vec::new();
    for (i, value) in list(attributes, "tables", wrong).iter().enumerate() {
        match one(value) {
            Ok(mut table) => {
                wrong.extend(drop_odd_units(&mut table));
                wrong.extend(odd_rows(&table));
                tables.push(table);
            }
            Err(e) => wrong.push(unreadable("table", i, value, &e)),
        }
    }
    tables
}

/// A table as it is told; what is no cell is a text, as it is written.
fn one(value: &Value) -> serde_json::Result<Table> {
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

/// Says which rows have not a cell for each column, and whether there are too many.
fn odd_rows(table: &Table) -> Vec<String> {
    let of = |text: String| format!("table '{}': {text}", table.name);
    let wide = table.columns.len();
    let rows = table.rows.iter().map(Vec::len).enumerate();
    let odd = rows.filter(|(_, got)| *got != wide).map(|(i, got)| {
        let row = i + 1;
        of(format!("row {row} has {got} cells; expected {wide}"))
    });
    let all = table.rows.len();
    let many = (all > ROWS).then(|| of(format!("the first {ROWS} of its {all} rows are shown")));
    odd.chain(many).collect()
}
