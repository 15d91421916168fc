//! Its descriptor is not one.

use plyflow_sdk::abi::*;

/// Does nothing.
extern "C" fn run(_: *const pf_services) -> i32 {
    PF_OK
}

static FUNCTIONS: pf_step_functions = pf_step_functions {
    size: size_of::<pf_step_functions>() as u64,
    run,
};

static PLUGIN: pf_plugin = pf_plugin {
    magic: 0x1234,
    abi_major: PF_ABI_MAJOR,
    abi_minor: PF_ABI_MINOR,
    size: size_of::<pf_plugin>() as u64,
    kind: PF_KIND_STEP,
    reserved: 0,
    manifest: pf_str::new(
        r#"{
        "name": "bad-magic", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {}
    }"#,
    ),
    functions: (&raw const FUNCTIONS).cast(),
};

/// The plugin's entry point.
#[unsafe(no_mangle)]
pub extern "C" fn plyflow_plugin() -> *const pf_plugin {
    &raw const PLUGIN
}
