//! Writes where it may not.

use plyflow_sdk::{Host, Log, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "segfault", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p = std::hint::black_box(std::ptr::without_provenance_mut::<u8>(8));
        host.log(Log::Info, "about to write to address 8");
        // SAFETY: none. Address 8 is nobody's, and that the process dies of it is what the tests are about.
        unsafe { p.write_volatile(1) };
        Ok(())
    }
}

export_step!(Plugin);
