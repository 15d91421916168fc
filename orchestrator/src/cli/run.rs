//! `run` and `report`.

use super::args::{LogFormat, ReportArgs, RunArgs};
use super::clean::locked;
use super::open::{Opened, cores, open, program, store_root};
use super::results::{Row, check, cost_table, records, results_table, rows};
use super::{Done, Stop, print};
use crate::engine::core::Limits;
use crate::engine::{Failure, Local, Observer, Options, Session, Summary};
use crate::exit;
use crate::progress::{Bars, JsonLines, Lines, Quiet, duration_text};
use crate::store::Lock;
use plyflow_workflow::resolved::FailurePolicy;
use std::io::{IsTerminal, Read};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

/// Tables at the end of a run are shown up to this many rows.
const LONGEST_TABLE: usize = 40;
/// Lines of a failed step's log that are shown.
const LOG_LINES: usize = 15;

/// Ctrl-C and SIGTERM, counted, with something that becomes readable for `poll`.
struct Interrupts {
    wake: UnixStream,
    heard: Arc<AtomicU32>,
}

impl Interrupts {
    fn listen() -> std::io::Result<Self> {
        let (wake, write) = UnixStream::pair()?;
        wake.set_nonblocking(true)?;
        write.set_nonblocking(true)?;
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            signal_hook::low_level::pipe::register(signal, write.try_clone()?)?;
        }
        Ok(Self {
            wake,
            heard: Arc::default(),
        })
    }

    fn poll_end(&self) -> std::io::Result<OwnedFd> {
        Ok(self.wake.try_clone()?.into())
    }

    /// How many there have been.
    fn count(&self) -> u32 {
        let mut buffer = [0u8; 16];
        while let Ok(n) = (&self.wake).read(&mut buffer) {
            if n == 0 {
                break;
            }
            self.heard.fetch_add(n as u32, Ordering::Relaxed);
        }
        self.heard.load(Ordering::Relaxed)
    }
}

/// `plyflow run`.
///
/// # Errors
/// See [`exit`].
pub fn run(args: &RunArgs) -> Done {
    let begun = Instant::now();
    let file = &args.workflow.workflow;
    if file.is_file() {
        let root = store_root(&args.workflow.places, Some(file));
        std::fs::create_dir_all(&root)
            .map_err(Stop::machine(format!("making the store {root}")))?;
    }
    let mut opened = open(&args.workflow)?;
    opened.restrict(&args.until)?;
    let options = options(args, &opened)?;
    let folder = opened.store.run(&opened.workflow.name);
    let _store = Lock::shared(
        &opened.store.lock(),
        &format!("the store {}", opened.store.root()),
    )
    .map_err(locked)?;
    let what = format!("the workflow '{}'", opened.workflow.name);
    let _run = Lock::exclusive(&folder.lock(), &what).map_err(locked)?;
    let machine = || Stop::machine(format!("running with the store {}", opened.store.root()));
    let mut session = Session::new(
        &opened.workflow,
        &opened.graph,
        &opened.store,
        options,
        true,
    )
    .map_err(machine())?;
    let mut observer = observer(args);
    session.look(observer.as_mut());
    let interrupts = Interrupts::listen().map_err(machine())?;
    let wake = interrupts.poll_end().map_err(machine())?;
    let mut executor = Local::new(program()?, Some(wake));
    let (session, summary) = session
        .execute(&mut executor, observer.as_mut(), &|| interrupts.count())
        .map_err(machine())?;
    conclude(args, &opened, &session, &summary, begun)
}

fn options(args: &RunArgs, opened: &Opened) -> Result<Options, Stop> {
    let policy = match (args.keep_going, args.fail_fast) {
        (true, _) => FailurePolicy::KeepGoing,
        (_, true) => FailurePolicy::FailFast,
        _ => opened.workflow.on_failure,
    };
    let memory = match &args.memory {
        None => machine_memory() / 10 * 9,
        Some(text) => {
            text.parse::<plyflow_model::workflow::Memory>()
                .map_err(|e| Stop::new(exit::USAGE, format!("--memory {text}: {e}")))?
                .0
        }
    };
    Ok(Options {
        limits: Limits {
            cores: args.jobs.unwrap_or_else(cores),
            memory,
            policy,
        },
        search_path: opened.search_path.clone(),
        force: opened.step_indices(&args.force)?,
    })
}

/// Memory of this machine (bytes); 0 when the system does not tell.
fn machine_memory() -> u64 {
    let info = rustix::system::sysinfo();
    u64::from(info.mem_unit) * info.totalram as u64
}

fn observer(args: &RunArgs) -> Box<dyn Observer> {
    match args.log_format {
        LogFormat::Json => Box::new(JsonLines),
        LogFormat::Text if args.quiet => Box::new(Quiet),
        LogFormat::Text if std::io::stderr().is_terminal() => Box::new(Bars::default()),
        LogFormat::Text => Box::new(Lines::default()),
    }
}

/// Tells how the run went; what matters most comes last.
fn conclude(
    args: &RunArgs,
    opened: &Opened,
    session: &Session<'_>,
    summary: &Summary,
    begun: Instant,
) -> Done {
    let worked = summary.executed + summary.failures.len() + summary.skipped > 0;
    let mut verdict = Ok(());
    if worked || args.check {
        let records = records(session);
        let rows = rows(session, &records);
        if !args.quiet && args.log_format == LogFormat::Text {
            print(&short_results(args, &rows))?;
            if records.len() <= LONGEST_TABLE {
                print(&(cost_table(session, &records) + "\n"))?;
            }
        }
        if args.check {
            verdict = check(&rows);
        }
    }
    if !args.quiet {
        tell(args, opened, session, summary, begun)?;
    }
    if summary.interrupted {
        return Err(Stop::silent(exit::INTERRUPTED));
    }
    if let Some(first) = summary.failures.first() {
        eprint!("{}", failure_text(first, summary));
        return Err(Stop::silent(exit::STEP_FAILED));
    }
    verdict
}

/// The results, or when they are many those that are judged.
fn short_results(args: &RunArgs, rows: &[Row]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    if rows.len() <= LONGEST_TABLE {
        return results_table(rows) + "\n";
    }
    let judged: Vec<Row> = rows
        .iter()
        .filter(|r| r.expected.is_some())
        .cloned()
        .collect();
    let all = format!(
        "{} results: plyflow results {}\n\n",
        rows.len(),
        args.workflow.workflow
    );
    match judged.len() {
        1..=LONGEST_TABLE => results_table(&judged) + &all,
        _ => all,
    }
}

fn tell(
    args: &RunArgs,
    opened: &Opened,
    session: &Session<'_>,
    summary: &Summary,
    begun: Instant,
) -> Done {
    let wall = duration_text(begun.elapsed().as_secs_f64());
    let mut parts = vec![
        format!("{} run", summary.executed),
        format!("{} cached", summary.cached),
    ];
    for (n, word) in [
        (summary.failures.len(), "failed"),
        (summary.skipped, "not run"),
    ] {
        if n > 0 {
            parts.push(format!("{n} {word}"));
        }
    }
    let line = format!(
        "{}: {} in {wall}\n",
        session.workflow.name,
        parts.join(", ")
    );
    if args.log_format == LogFormat::Json {
        let line = serde_json::json!({
            "event": "end", "executed": summary.executed, "cached": summary.cached,
            "failed": summary.failures.len(), "not_run": summary.skipped,
            "interrupted": summary.interrupted, "seconds": begun.elapsed().as_secs_f64(),
        });
        eprintln!("{line}");
        return Ok(());
    }
    print(&line)?;
    if summary.interrupted {
        let file = &opened.workflow.file;
        print(&format!(
            "stopped; what is finished is kept. To go on: plyflow run {file}\n"
        ))?;
    }
    Ok(())
}

/// The first failure with its log, last on the screen.
fn failure_text(first: &Failure, summary: &Summary) -> String {
    let mut out = String::new();
    for other in summary.failures.iter().skip(1).take(20) {
        out += &format!(
            "also failed: {}: {}\n",
            other.label,
            first_line(&other.reason)
        );
    }
    out += &format!(
        "\nfirst failure: {}\n  {}\n",
        first.label,
        first.reason.replace('\n', "\n  ")
    );
    if let Some(log) = &first.log {
        let bytes = std::fs::read(log).unwrap_or_default();
        let text = String::from_utf8_lossy(&bytes);
        let lines: Vec<&str> = text.lines().collect();
        let tail = &lines[lines.len().saturating_sub(LOG_LINES)..];
        out += &format!("  log: {log}\n");
        for line in tail {
            out += &format!("  | {line}\n");
        }
    }
    out
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

/// `plyflow report`.
///
/// # Errors
/// See [`Stop`].
pub fn report(args: &ReportArgs) -> Done {
    let opened = open(&args.workflow)?;
    let _session = opened.look()?;
    Err(Stop::new(
        exit::INTERNAL,
        format!("no report writer for {}", opened.workflow.name),
    ))
}
