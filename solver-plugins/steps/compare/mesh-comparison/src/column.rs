//! Columns of both tables.

use plyflow_model::artifact::Column;

/// A column of seconds that are told from the results.
pub fn measured(label: &str, result: &str) -> Column {
    Column {
        measured: Some(result.to_owned()),
        ..Column::new(label, "s")
    }
}
