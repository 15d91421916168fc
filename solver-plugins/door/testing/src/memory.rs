//! What the host in memory holds: artifacts, inputs, a machine.

use plyflow_sdk::On;
use plyflow_sdk::abi::pf_component;
use serde_json::Value;
use std::collections::BTreeMap;

/// A point (m).
pub type Vec3 = [f64; 3];

/// A field of a body in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct MemoryField {
    /// Name.
    pub name: String,
    /// On points or cells.
    pub on: On,
    /// Values per point or cell.
    pub components: u32,
    /// `[rows * components]`.
    pub values: Vec<f64>,
}

/// A body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MemoryBody {
    /// Name.
    pub name: String,
    /// Reference points (m).
    pub points: Vec<Vec3>,
    /// 3 or 4.
    pub nodes_per_cell: usize,
    /// `[m * nodes_per_cell]`.
    pub cells: Vec<u32>,
    /// What the plugin said of it.
    pub attributes: Value,
    /// Points of each frame (m).
    pub frames: Vec<Vec<Vec3>>,
    /// Fields of each frame.
    pub fields: Vec<Vec<MemoryField>>,
}

impl MemoryBody {
    /// Values of a field in the last frame.
    ///
    /// # Panics
    /// When there is none of that name.
    pub fn last(&self, field: &str) -> &[f64] {
        let fields = self
            .fields
            .last()
            .unwrap_or_else(|| panic!("'{}' has no frame", self.name));
        let found = fields.iter().find(|f| f.name == field);
        &found
            .unwrap_or_else(|| panic!("'{}' has no field '{field}'", self.name))
            .values
    }
}

/// An artifact.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MemoryArtifact {
    /// Artifact kind.
    pub kind: String,
    /// Attributes.
    pub attributes: Value,
    /// Arrays by path: shape and values (u32 arrays as f64).
    pub arrays: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
    /// Frame times (s).
    pub times: Vec<f64>,
    /// Bodies.
    pub bodies: Vec<MemoryBody>,
    /// Results: value and unit.
    pub results: BTreeMap<String, (f64, String)>,
    /// Measured results: value and unit.
    pub measured: BTreeMap<String, (f64, String)>,
    /// Labels of the collection.
    pub collection: Option<Vec<String>>,
    /// Log lines.
    pub log: Vec<String>,
}

impl MemoryArtifact {
    /// The body of that name.
    ///
    /// # Panics
    /// When there is none.
    pub fn body(&self, name: &str) -> &MemoryBody {
        let found = self.bodies.iter().find(|b| b.name == name);
        found.unwrap_or_else(|| panic!("no body '{name}'"))
    }

    /// Value of a result.
    ///
    /// # Panics
    /// When there is none of that name.
    pub fn result(&self, name: &str) -> f64 {
        let found = self.results.get(name);
        found
            .unwrap_or_else(|| panic!("no result '{name}': {:?}", self.results.keys()))
            .0
    }
}

/// One input of a run.
#[derive(Debug, Clone, Copy)]
pub struct MemoryInput<'a> {
    /// Port.
    pub port: &'a str,
    /// Name of the step that it comes from.
    pub step: &'a str,
    /// The artifact.
    pub artifact: &'a MemoryArtifact,
    /// Its fan-out index path.
    pub item: &'a [u64],
    /// Wall and CPU seconds, peak memory (bytes).
    pub cost: [f64; 3],
}

impl<'a> MemoryInput<'a> {
    /// An input without fan-out and cost, from a step that is called as the port is.
    pub fn new(port: &'a str, artifact: &'a MemoryArtifact) -> Self {
        Self {
            port,
            step: port,
            artifact,
            item: &[],
            cost: [0.0; 3],
        }
    }
}

/// What a host offers besides the workflow.
#[derive(Debug, Clone, Copy)]
pub struct Machine {
    /// Threads that the step may use.
    pub threads: u32,
    /// Whether the run is being stopped.
    pub cancelled: bool,
    /// Element formulations and materials.
    pub components: Components,
}

/// Where a host in memory has components from.
#[derive(Debug, Clone, Copy)]
pub struct Components(fn(u32, &str) -> Option<pf_component>);

impl Components {
    /// None at all.
    pub const NONE: Self = Self(|_, _| None);

    /// Those that `find` gives for a kind (`PF_KIND_*`) and a name.
    ///
    /// # Safety
    /// What it gives is of that kind: a whole table that keeps to plyflow.h and a manifest that can be read, both valid until the process ends. Steps call
    /// it without looking.
    pub const unsafe fn new(find: fn(u32, &str) -> Option<pf_component>) -> Self {
        Self(find)
    }

    pub(crate) fn find(self, kind: u32, name: &str) -> Option<pf_component> {
        (self.0)(kind, name)
    }
}

impl Default for Machine {
    /// One thread, no components.
    fn default() -> Self {
        Self {
            threads: 1,
            cancelled: false,
            components: Components::NONE,
        }
    }
}
