//! Running one step in this process.

use crate::emitter::Emitter;
use crate::host::HostState;
use crate::lent::Lent;
use crate::load::Plugin;
use crate::{process, services};
use camino::Utf8Path;
use plyflow_abi::*;
use plyflow_artifact::ErrorKind;
use plyflow_artifact::seal::{hash_file, seal};
use plyflow_model::job::{Cost, FailureKind, JOB_VERSION, Job, LogLevel, Message, Record};
use plyflow_model::manifest::PluginKind;
use std::io::{Read, Write};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Why a step failed: the class and the text for the user.
type Failure = (FailureKind, String);

/// The body of `plyflow step-worker JOB`: reads a [`Job`] from the file (`-`: standard input), runs it
/// and talks in [`Message`]s on standard output. What the plugin prints goes to standard error.
///
/// Returns the exit code: 0 when the artifact is whole, 1 when the step failed, 2 when there is no job.
///
/// # Safety
/// This process has one thread: the environment is written to.
#[must_use]
pub unsafe fn worker_main(source: &str) -> i32 {
    process::become_worker();
    let mut out = process::private_stdout();
    let mut document = Vec::new();
    let read = if source == "-" {
        std::io::stdin().lock().read_to_end(&mut document)
    } else {
        std::fs::File::open(source).and_then(|mut f| f.read_to_end(&mut document))
    };
    let (text, lent) = Lent::split(&document, std::io::stdin());
    let job = read
        .map_err(|e| e.to_string())
        .and_then(|_| serde_json::from_slice::<Job>(text).map_err(|e| e.to_string()));
    drop(document);
    match job {
        Ok(job) => {
            // SAFETY: one thread (the caller's promise): nothing above has begun another.
            unsafe {
                process::announce_threads(job.threads.max(1));
                process::limit_memory(job.memory_limit);
            }
            run_with(&job, lent, &mut out)
        }
        Err(e) => {
            let message = format!("the job {source} cannot be read: {e}");
            Emitter::new(&mut out).send(&Message::Failed {
                kind: FailureKind::Load,
                message,
            });
            2
        }
    }
}

/// Runs a step in this process: loads the plugin, calls it, writes artifact and record under the names
/// that the job gives, and ends the stream of messages with `done` or `failed`. After a failure neither
/// file is left behind.
///
/// Returns the exit code: 0 or 1.
#[must_use]
pub fn run_job(job: &Job, events: &mut (dyn Write + Send)) -> i32 {
    run_with(job, Lent::default(), events)
}

/// [`run_job`], with what an engine tells meanwhile.
fn run_with(job: &Job, lent: Lent, events: &mut (dyn Write + Send)) -> i32 {
    let emitter = Emitter::new(events);
    let outcome = run(job, lent, &emitter);
    if job.scratch.exists()
        && let Err(e) = std::fs::remove_dir_all(&job.scratch)
    {
        let text = format!(
            "the scratch folder {} could not be removed: {e}",
            job.scratch
        );
        emitter.log(LogLevel::Debug, &text);
    }
    match outcome {
        Ok(record) => {
            emitter.send(&Message::Done {
                record: Box::new(record),
            });
            0
        }
        Err((kind, message)) => {
            let _ = std::fs::remove_file(&job.artifact);
            let _ = std::fs::remove_file(&job.record);
            emitter.send(&Message::Failed { kind, message });
            1
        }
    }
}

fn run(job: &Job, lent: Lent, emitter: &Emitter<'_>) -> Result<Record, Failure> {
    let started = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64();
    let plugin = load(job)?;
    let malformed = |text: String| (FailureKind::Malformed, text);
    let state =
        HostState::new(job, &plugin, emitter, lent).map_err(|e| (kind_of(e.kind), e.message))?;
    let clock = Instant::now();
    let table = services::table(&state);
    let functions = plugin.functions().cast::<pf_step_functions>();
    // SAFETY: `load` has found a step, with a whole table of functions that stays. The services' table lives until `run` returns, as the state
    // behind it does.
    let code = unsafe { ((*functions).run)(&raw const table) };
    let wall_seconds = clock.elapsed().as_secs_f64();

    let cost = state.checkpoints.with_earlier(Cost {
        wall_seconds,
        // With what it has started and waited for: a step in Python runs in a process of its own.
        cpu_seconds: process::cpu_seconds() + process::children_seconds(),
        peak_memory: process::peak_memory().max(process::children_peak_memory()),
        threads: state.most_threads(),
    });
    let mut output = state.output();
    judge(job, code, &mut output)?;
    let writer = output.writer.take().expect("only taken here");
    let labels = writer.labels().map(<[String]>::to_vec);
    if job.collection && labels.is_none() {
        return Err(malformed(format!(
            "the manifest of '{}' declares a collection, but the step declared none: call \
             `collection`, with no items if there are none",
            job.plugin.name
        )));
    }
    let bytes = writer
        .finish(&job.provenance)
        .map_err(|e| (kind_of(e.kind), e.message))?;
    let hash = sealed_hash(job, bytes)?;
    let record = Record {
        version: JOB_VERSION,
        step: job.step.clone(),
        item: job.item.clone(),
        key: job.key.clone(),
        kind: job.output_kind.clone(),
        bytes,
        hash,
        cost,
        results: std::mem::take(&mut output.results),
        collection: labels,
        warnings: emitter.warnings(),
        host: process::host_name(),
        started,
    };
    put_on_disk(job, &record)?;
    Ok(record)
}

/// The class of a step's failure by that of its artifact's: a full disk is no fault of the plugin's.
fn kind_of(kind: ErrorKind) -> FailureKind {
    match kind {
        ErrorKind::Io => FailureKind::Error,
        _ => FailureKind::Malformed,
    }
}

/// Writes the record; what was long in the making outlasts a power cut, with its artifact.
fn put_on_disk(job: &Job, record: &Record) -> Result<(), Failure> {
    let lasting = record.is_lasting();
    let failed = |what: String| (FailureKind::Error, what);
    write_record(&job.record, record, lasting)
        .map_err(|e| failed(format!("the record {} cannot be written: {e}", job.record)))?;
    if !lasting {
        return Ok(());
    }
    let artifact = &job.artifact;
    std::fs::File::open(artifact)
        .and_then(|file| file.sync_all())
        .map_err(|e| {
            failed(format!(
                "the artifact {artifact} cannot be put on the disk: {e}"
            ))
        })
}

/// The hash of the artifact as the disk has it, `bytes` long.
fn sealed_hash(job: &Job, bytes: u64) -> Result<String, Failure> {
    let path = &job.artifact;
    match hash_file(path.as_std_path()) {
        Ok((hash, found)) if found == bytes => Ok(hash),
        Ok((_, found)) => {
            let text = format!(
                "the artifact {path} has {found} bytes and {bytes} were written: something else has changed it"
            );
            Err((FailureKind::Malformed, text))
        }
        Err(e) => {
            let text = format!("the artifact {path} cannot be read again: {e}");
            Err((FailureKind::Error, text))
        }
    }
}

fn load(job: &Job) -> Result<Plugin, Failure> {
    let failed = |text: String| (FailureKind::Load, text);
    if job.version != JOB_VERSION {
        return Err(failed(format!(
            "the job is of version {}, this program runs version {JOB_VERSION}: engine and worker \
             must be the same release",
            job.version
        )));
    }
    let hash = job.plugin.hash.as_deref();
    let plugin = Plugin::load_bytes(&job.plugin.path, hash).map_err(|e| failed(e.to_string()))?;
    if plugin.manifest.kind != PluginKind::Step {
        return Err(failed(format!(
            "{}: the plugin '{}' is of kind {}; a step needs kind step",
            plugin.path, plugin.manifest.name, plugin.manifest.kind
        )));
    }
    Ok(plugin)
}

/// Turns the plugin's status, its text and the host's reasons into one verdict.
fn judge(job: &Job, code: i32, output: &mut crate::host::Output) -> Result<(), Failure> {
    let said = output.failure.take();
    let because = |detail: Option<String>| match detail {
        Some(d) => format!(": {d}"),
        None => String::new(),
    };
    let name = &job.plugin.name;
    if let Some(refused) = output.refused.take() {
        // A write was refused: that is the cause, whatever the plugin made of it.
        let kind = kind_of(refused.kind);
        let refused = refused.message;
        let text = match (code, said) {
            (PF_OK, _) => format!(
                "{refused} (the host refused this write; the plugin '{name}' did not heed it)"
            ),
            (_, Some(said)) if !said.contains(&refused) => format!("{said}: {refused}"),
            (_, Some(said)) => said,
            (_, None) => refused,
        };
        return Err((kind, text));
    }
    match code {
        PF_OK => Ok(()),
        PF_CANCELLED if process::cancelled() => {
            Err((FailureKind::Cancelled, "the step was stopped".into()))
        }
        PF_CANCELLED => {
            let text = format!(
                "the plugin '{name}' returned PF_CANCELLED, but nobody asked it to stop: it is for when `cancelled` has said 1"
            );
            Err((FailureKind::Error, text + &because(said)))
        }
        PF_PANIC => {
            let text = said.unwrap_or_else(|| format!("the plugin '{name}' panicked"));
            Err((FailureKind::Panic, text))
        }
        code => {
            let text = said.unwrap_or_else(|| {
                format!("the plugin '{name}' returned status {code} without saying why")
            });
            Err((FailureKind::Error, text + &because(output.detail.take())))
        }
    }
}

fn write_record(path: &Utf8Path, record: &Record, lasting: bool) -> std::io::Result<()> {
    let text = seal(&serde_json::to_string_pretty(record)?);
    let mut file = std::fs::File::create(path)?;
    file.write_all(text.as_bytes())?;
    if lasting { file.sync_all() } else { Ok(()) }
}
