//! A step of Plyflow in Rust. It multiplies the array "history/time" of its input, writes it with how many values it has, and reports
//! their sum. Take it as a start: change `manifest.json`, then `run`.

use plyflow_sdk::{Host, Log, Step, StepError, export_step};

/// Parameters as the manifest declares them: checked by the host, defaults filled in, SI numbers.
#[derive(serde::Deserialize)]
struct Parameters {
    factor: f64,
}

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let formed = host.input("formed")?;
        let (mut time, shape) = host.array_f64(&formed, "history/time")?;
        let mut sum = 0.0;
        for (i, t) in time.iter_mut().enumerate() {
            if i % 1024 == 0 {
                host.check_cancelled()?;
            }
            *t *= p.factor;
            sum += *t;
        }
        host.log(Log::Info, &format!("multiplied {} times", time.len()));
        host.write_f64("history/time", &shape, "s", &time)?;
        host.write_attributes(&serde_json::json!({"count": time.len()}))?;
        host.result("sum", sum, "s")
    }
}

export_step!(Plugin);
