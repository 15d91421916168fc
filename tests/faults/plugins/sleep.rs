//! Waits, reports progress and stops when it is told to.

use plyflow_sdk::{Host, Progress, Step, StepError, export_step};
use std::time::{Duration, Instant};

#[derive(serde::Deserialize)]
struct Parameters {
    seconds: f64,
}

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "sleep", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {"seconds": {"type": "number", "default": 0.1, "minimum": 0, "doc": "How long (s)."}},
        "inputs": {"in": {"kind": "any", "required": false, "many": true, "doc": "Anything."}},
        "output": {"kind": "test"},
        "results": {"slept": {"unit": "s", "doc": "How long it slept.", "measured": true}}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let clock = Instant::now();
        loop {
            let elapsed = clock.elapsed().as_secs_f64();
            let fraction = if p.seconds > 0.0 {
                elapsed / p.seconds
            } else {
                1.0
            };
            host.progress(&Progress {
                fraction: fraction.min(1.0),
                simulated_time: elapsed,
                rate: 100.0,
                phase: "sleeping",
                ..Progress::default()
            });
            if fraction >= 1.0 {
                break;
            }
            host.check_cancelled()?;
            std::thread::sleep(Duration::from_millis(5));
        }
        host.write_attributes(&serde_json::json!({"value": p.seconds}))?;
        host.measured("slept", clock.elapsed().as_secs_f64(), "s")
    }
}

export_step!(Plugin);
