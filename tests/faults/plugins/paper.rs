//! A material that does nothing.

use plyflow_sdk::{Material, MaterialSizes, MembraneBatch, export_material};

struct Paper;

impl Material for Paper {
    const MANIFEST: &'static str = r#"{
        "name": "paper", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "material",
        "role": "material", "summary": "A test material.", "parameters": {}
    }"#;

    fn create(_: &str) -> Result<Self, String> {
        Ok(Self)
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            thickness: 1e-4,
            areal_mass: 0.08,
            ..MaterialSizes::default()
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        b.stress.fill(0.0);
        b.energy.fill(0.0);
    }
}

export_material!(Paper);
