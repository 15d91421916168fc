//! Asks the host for a material component and reports its modulus.

use plyflow_sdk::abi::*;
use plyflow_sdk::{Host, Step, StepError, export_step};

struct Plugin;

#[derive(serde::Deserialize)]
struct Parameters {
    material: String,
}

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "component", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {"material": {"type": "string", "required": true, "doc": "Name of a material."}},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {"thickness": {"unit": "m", "doc": "Thickness of the material."}}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let component = host.component(PF_KIND_MATERIAL, &p.material)?;
        let functions = component.functions.cast::<pf_material_functions>();
        let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
        // SAFETY: the host's table of a material, valid until the process ends; a text, room for the instance and a whole `pf_error`.
        let code =
            unsafe { ((*functions).create)(pf_str::new("{}"), &raw mut instance, &raw mut error) };
        if code != PF_OK {
            return Err(StepError::Failed(error.get()));
        }
        let mut sizes = pf_material_sizes::default();
        // SAFETY: the instance that the table has just made; a whole struct, as its `size` says.
        unsafe { ((*functions).sizes)(instance, &raw mut sizes) };
        // SAFETY: made above, ended once.
        unsafe { ((*functions).destroy)(instance) };
        host.result("thickness", sizes.thickness, "m")
    }
}

export_step!(Plugin);
