//! Histories of a run.

use crate::read::error::ReadError;
use crate::read::facts::open;
use camino::Utf8Path;
use std::collections::BTreeMap;

/// Histories by name, all of one length; empty when there is none.
#[derive(Debug, Clone, Default)]
pub(crate) struct History {
    pub(crate) columns: BTreeMap<String, Vec<f64>>,
}

impl History {
    pub(crate) fn read(path: &Utf8Path) -> Result<Self, ReadError> {
        let artifact = open(path)?;
        let mut columns = BTreeMap::new();
        for info in &artifact.contents().arrays {
            let Some(name) = info.path.strip_prefix("history/") else {
                continue;
            };
            let (data, shape) = artifact.array_f64(&info.path)?;
            if shape.len() == 1 {
                columns.insert(name.to_owned(), data);
            }
        }
        let rows = columns.get("time").map_or(0, Vec::len);
        columns.retain(|_, c| c.len() == rows && rows > 1);
        Ok(Self { columns })
    }

    /// A column, if there is one.
    pub(crate) fn get(&self, name: &str) -> Option<&[f64]> {
        self.columns.get(name).map(Vec::as_slice)
    }

    /// Membrane, bending and hourglass energy (J).
    pub(crate) fn internal(&self) -> Option<Vec<f64>> {
        let parts = ["membrane", "bending", "hourglass"].map(|n| self.get(n));
        let rows = parts.iter().flatten().next()?.len();
        Some(
            (0..rows)
                .map(|i| parts.iter().flatten().map(|p| p[i]).sum())
                .collect(),
        )
    }
}
