//! `m4`: a four-node membrane quadrilateral in space with one point and hourglass control (the
//! M3D4R of the thesis). The mechanics stand in [`crate::quad`].

use crate::quad::{self, Hourglass};
use crate::record;
use crate::thickening;
use plyflow_sdk::{Element, ElementBatch, ElementSizes, ElementTape, MaterialRef, MaterialSizes};

/// Parameters of `m4` and `rf4`; see their manifests.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Parameters {
    hourglass: f64,
    hourglass_floor: f64,
    hourglass_normal: f64,
    pub(crate) thickening: u32,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            hourglass: 1.0,
            hourglass_floor: 3000.0,
            hourglass_normal: 0.01,
            thickening: 0,
        }
    }
}

impl Parameters {
    pub(crate) fn parse(text: &str, element: &str) -> Result<Self, String> {
        let p: Self = serde_json::from_str(text)
            .map_err(|e| format!("parameters of element '{element}': {e}"))?;
        thickening::check(p.thickening)?;
        Ok(p)
    }

    pub(crate) fn hourglass(&self, material: &MaterialRef) -> Result<Hourglass, String> {
        Hourglass::new(
            self.hourglass,
            self.hourglass_floor,
            self.hourglass_normal,
            material,
        )
    }
}

/// The formulation for one material.
pub struct M4 {
    hourglass: Hourglass,
}

impl Element for M4 {
    const MANIFEST: &'static str = include_str!("m4/manifest.json");

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        let p = Parameters::parse(parameters, "m4")?;
        if p.thickening > 0 {
            return Err(format!(
                "thickening: given {} to the membrane 'm4', which does not bend: use 'rf4' or 's4'",
                p.thickening
            ));
        }
        Ok(Self {
            hourglass: p.hourglass(material)?,
        })
    }

    fn sizes(&self) -> ElementSizes {
        quad::sizes()
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        quad::initialise(batch, material, self.hourglass);
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        quad::forces(batch, material)
    }

    fn tape(&self, what: ElementTape, material: &MaterialSizes) -> Result<Option<String>, String> {
        record::of_element(self, what, *material)
    }
}
