//! `m4`: a four-node membrane quadrilateral in space with one point and hourglass control (the
//! M3D4R of the thesis). The mechanics stand in [`crate::quad`].

use crate::quad::{self, Hourglass};
use plyflow_sdk::{Element, ElementBatch, ElementSizes, MaterialRef};

/// Parameters; see the manifest.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Parameters {
    hourglass: f64,
    hourglass_floor: f64,
    hourglass_normal: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            hourglass: 1.0,
            hourglass_floor: 3000.0,
            hourglass_normal: 0.01,
        }
    }
}

/// The formulation for one material.
pub struct M4 {
    hourglass: Hourglass,
}

impl Element for M4 {
    const MANIFEST: &'static str = include_str!("../../element-m4/manifest.json");

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        let p: Parameters = serde_json::from_str(parameters)
            .map_err(|e| format!("parameters of element 'm4': {e}"))?;
        Ok(Self {
            hourglass: Hourglass::new(
                p.hourglass,
                p.hourglass_floor,
                p.hourglass_normal,
                material,
            )?,
        })
    }

    fn sizes(&self) -> ElementSizes {
        ElementSizes {
            nodes: 4,
            dofs_per_node: 3,
            constants: quad::CONSTANTS,
            material_points: 1,
            fields: quad::FIELDS,
            ..Default::default()
        }
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        quad::initialise(batch, material, self.hourglass);
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        quad::forces(batch, material)
    }
}
