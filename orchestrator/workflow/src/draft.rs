//! What is looked at while a workflow is resolved: its schema, and its steps.

use crate::catalog::CatalogEntry;
use crate::yaml::Entry;
use plyflow_model::schema;
use serde_json::Value;
use std::rc::Rc;
use std::sync::LazyLock;

/// The JSON Schema of workflow files.
pub(crate) static WORKFLOW: LazyLock<Value> = LazyLock::new(schema::workflow);

/// One step while it is being resolved.
#[derive(Clone)]
pub(crate) struct Draft<'n> {
    /// Its entry in `steps`.
    pub entry: &'n Entry,
    /// Its number among the steps of the file.
    pub index: usize,
    /// Its plugin, if it was found.
    pub plugin: Option<Rc<CatalogEntry>>,
}

impl Draft<'_> {
    /// Its name.
    pub fn name(&self) -> &str {
        &self.entry.key
    }
}
