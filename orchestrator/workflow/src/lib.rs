//! YAML -> resolved workflow. Every error has file, line, column, the value, what was expected and the
//! nearest valid name; all errors of a pass are reported together.

mod catalog;
mod check;
mod confirm;
mod diagnostics;
mod draft;
mod evidence;
mod expect;
mod gathered;
mod graph;
mod hints;
mod limits;
mod load;
mod named;
mod overrides;
mod parameters;
mod paths;
mod plies;
mod profile;
pub mod resolved;
mod results;
mod scene;
mod scene_rules;
mod study;
mod text;
mod wires;
mod yaml;

pub use catalog::{Catalog, CatalogEntry, CatalogError};
pub use confirm::variants_of;
pub use diagnostics::{Diagnostic, Diagnostics, Further, Severity};
pub use evidence::{Evidence, Resolution};
pub use graph::{dependencies, graph, to_dot, to_mermaid};
pub use load::{
    Part, Wanted, check_part, load, load_with, name_of, plugin_search_folders, resolve,
    resolve_wanted, resolve_with_points,
};
pub use overrides::{Override, OverrideError};
pub use profile::load_profile;
pub use resolved::ResolvedWorkflow;
pub use study::PointsOf;
