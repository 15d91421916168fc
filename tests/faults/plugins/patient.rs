//! Works for a time in small pieces, keeps checkpoints, and notes in a file of the test when it begins, goes on and ends: so that a test
//! can count what was run twice. Notes too with how many threads it may go on, when they change. May also take memory.

use plyflow_sdk::{Host, Progress, Step, StepError, export_step};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

#[derive(serde::Deserialize)]
struct Parameters {
    value: f64,
    seconds: f64,
    megabytes: u32,
    ledger: String,
    checkpoints: bool,
}

struct Plugin;

/// Time between two looks at the clock.
const PIECE: Duration = Duration::from_millis(5);

fn note(p: &Parameters, what: &str) -> Result<(), StepError> {
    if p.ledger.is_empty() {
        return Ok(());
    }
    let mut file = std::fs::File::options()
        .append(true)
        .create(true)
        .open(&p.ledger)?;
    // One short write, which the kernel appends whole.
    file.write_all(format!("{what} {}\n", p.value).as_bytes())?;
    Ok(())
}

fn save(folder: Option<&str>, done: f64) -> Result<(), StepError> {
    let Some(folder) = folder else { return Ok(()) };
    let new = Path::new(folder).join("new");
    std::fs::write(&new, done.to_string())?;
    std::fs::rename(new, Path::new(folder).join("done"))?;
    Ok(())
}

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "patient", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {
            "value": {"type": "number", "default": 0, "doc": "The number."},
            "seconds": {"type": "number", "default": 0, "minimum": 0, "doc": "How long (s)."},
            "megabytes": {"type": "integer", "default": 0, "minimum": 0, "doc": "Memory that it takes."},
            "ledger": {"type": "string", "default": "", "doc": "File that it notes begin and end in."},
            "checkpoints": {"type": "boolean", "default": true, "doc": "Whether it keeps checkpoints."}
        },
        "inputs": {"in": {"kind": "any", "required": false, "many": true, "doc": "Anything."}},
        "output": {"kind": "test"},
        "results": {"value": {"unit": "1", "doc": "The number."}}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let folder = host
            .checkpoint()
            .filter(|_| p.checkpoints)
            .map(str::to_owned);
        let saved = folder
            .as_ref()
            .and_then(|f| std::fs::read_to_string(Path::new(f).join("done")).ok());
        let before: f64 = saved.and_then(|t| t.parse().ok()).unwrap_or(0.0);
        note(&p, if before > 0.0 { "on" } else { "begin" })?;
        let taken = vec![1u8; p.megabytes as usize * 1_000_000];
        let (clock, mut threads) = (Instant::now(), host.threads());
        loop {
            if threads != host.threads() {
                threads = host.threads();
                note(&p, &format!("threads {threads} of"))?;
            }
            let done = before + clock.elapsed().as_secs_f64();
            if done >= p.seconds {
                break;
            }
            host.progress(&Progress {
                fraction: done / p.seconds,
                phase: "waiting",
                ..Progress::default()
            });
            if let Err(stopped) = host.check_cancelled() {
                save(folder.as_deref(), done)?;
                return Err(stopped);
            }
            if host.checkpoint_due() {
                save(folder.as_deref(), done)?;
                host.checkpoint_saved();
            }
            std::thread::sleep(PIECE);
        }
        let sum: u64 = taken.iter().step_by(4096).map(|b| u64::from(*b)).sum();
        note(&p, "end")?;
        host.write_attributes(&serde_json::json!({"value": p.value, "pages": sum}))?;
        host.result("value", p.value, "1")
    }
}

export_step!(Plugin);
