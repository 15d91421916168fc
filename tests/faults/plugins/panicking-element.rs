//! An element that panics in its second call of forces, as an index out of bounds would.

use plyflow_sdk::{Element, ElementBatch, ElementSizes, MaterialRef, export_element};

struct Plugin;

impl Element for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "panicking-element", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "element",
        "role": "element", "summary": "A test plugin.", "parameters": {}, "inputs": {}, "results": {}, "fields": []
    }"#;

    fn create(_: &str, _: &MaterialRef) -> Result<Self, String> {
        Ok(Self)
    }

    fn sizes(&self) -> ElementSizes {
        ElementSizes {
            nodes: 4,
            dofs_per_node: 3,
            ..ElementSizes::default()
        }
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, _: &MaterialRef) {
        batch.mass.fill(1.0);
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, _: &MaterialRef) -> i32 {
        let beyond = std::hint::black_box(batch.force.len());
        batch.force[beyond] = 0.0;
        0
    }
}

export_element!(Plugin);
