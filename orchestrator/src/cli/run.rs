//! `run`.

use super::args::{LogFormat, RunArgs};
use super::open::{Opened, cores, open, store_root};
use super::report;
use super::results::checked;
use crate::engine::core::{Instance, Limits, State};
use crate::engine::{Depth, Failure, Local, Observer, Options, Session, Summary};
use crate::exit;
use crate::progress::{Bars, JsonLines, Lines, Quiet, duration_text};
use crate::store::{Early, Store};
use crate::said::{Done, Stop, print, warn};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::text::{one_line, shortened};
use plyflow_model::units::parse_quantity_in;
use plyflow_workflow::resolved::FailurePolicy;
use std::io::{IsTerminal, Read, Seek, SeekFrom};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Instant;

/// How often what turns out to be damaged at the end of a run is made again.
pub(super) const ROUNDS: usize = 2;

/// Lines of a failed step's log that are shown.
const LOG_LINES: usize = 15;

/// Bytes at the end of it among which these are.
const LOG_BYTES: u64 = 64 << 10;

/// Characters of each that are shown.
const LONGEST_LOG_LINE: usize = 2000;

/// Ctrl-C, SIGTERM and SIGHUP, counted, with something that becomes readable for `poll`.
pub(super) struct Interrupts {
    wake: UnixStream,
    heard: Arc<AtomicU32>,
}

impl Interrupts {
    pub(super) fn listen() -> std::io::Result<Self> {
        let (wake, write) = UnixStream::pair()?;
        wake.set_nonblocking(true)?;
        write.set_nonblocking(true)?;
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            signal_hook::low_level::pipe::register(signal, write.try_clone()?)?;
        }
        Self::listen_to_hangups(write)?;
        Ok(Self {
            wake,
            heard: Arc::default(),
        })
    }

    /// A closed terminal counts once: the shell and the kernel may both tell of it, and the second would not let steps end in order.
    /// Whoever ignores it (`nohup`) goes on.
    fn listen_to_hangups(write: UnixStream) -> std::io::Result<()> {
        let mut before: libc::sigaction = unsafe { std::mem::zeroed() };
        let asked = unsafe { libc::sigaction(libc::SIGHUP, std::ptr::null(), &raw mut before) };
        if asked == 0 && before.sa_sigaction == libc::SIG_IGN {
            return Ok(());
        }
        let told = AtomicBool::new(false);
        let tell = move || {
            if !told.swap(true, Ordering::Relaxed) {
                let _ = rustix::io::write(&write, b"X");
            }
        };
        // An atomic and a write to a socket that does not block: both are allowed in a handler.
        unsafe { signal_hook::low_level::register(signal_hook::consts::SIGHUP, tell) }?;
        Ok(())
    }

    pub(super) fn poll_end(&self) -> std::io::Result<OwnedFd> {
        Ok(self.wake.try_clone()?.into())
    }

    /// How many there have been.
    pub(super) fn count(&self) -> u32 {
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
    let early = Early::begin(&Store::new(store_root(&args.workflow.places, Some(file))));
    let mut opened = open(&args.workflow)?;
    if let Some(o) = super::optimise::of(&opened) {
        drop(early);
        return super::optimise::run(args, &opened, o, begun);
    }
    opened.restrict(&args.until)?;
    let options = options(args, &opened)?;
    let _locks = opened.lock()?;
    let machine = || Stop::machine(format!("running with the store {}", opened.store.root()));
    let mut session = Session::new_after(
        &opened.workflow,
        &opened.graph,
        &opened.store,
        options,
        true,
        early,
    )
    .map_err(machine())?;
    let mut observer = observer(args);
    session.look(observer.as_mut());
    if let Err(stop) = opened.admit(&session) {
        observer.end();
        return Err(stop);
    }
    let interrupts = Interrupts::listen().map_err(machine())?;
    let wake = interrupts.poll_end().map_err(machine())?;
    // Not the path: a build that replaces the program in the middle of a run must not mix versions.
    let mut executor = Local::new("/proc/self/exe".into(), Some(wake));
    for text in session.told() {
        tell_damage(args, text);
    }
    let mut all = Summary::default();
    for round in 0.. {
        let (ended, summary) = session
            .execute(&mut executor, observer.as_mut(), &|| interrupts.count())
            .map_err(machine())?;
        session = ended;
        all.add(summary);
        // What is about to be printed is read first; what is not as it was written is made again, as long as that helps.
        let depth = about_to_read(args, &opened, &session, &all);
        let lost = match depth {
            Some(depth) if !all.interrupted => session.recheck(&|_| true, depth, observer.as_mut()),
            _ => 0,
        };
        if lost == 0 {
            break;
        }
        if round == ROUNDS {
            let text = format!(
                "made again {ROUNDS} times in this run, and each time damaged when it was read: look after the disk and the memory of this machine"
            );
            return Err(Stop::new(exit::DAMAGED, text));
        }
    }
    let end = conclude(args, &opened, &session, &all, begun);
    // The process ends with this: to give ten thousand steps back to the allocator takes longer than to look at them.
    std::mem::forget(session);
    std::mem::forget(opened);
    end
}

/// Says what was found damaged of the files of the run itself.
fn tell_damage(args: &RunArgs, text: &str) {
    match args.log_format {
        LogFormat::Json => {
            let line = serde_json::json!({"event": "damaged", "what": text});
            warn(&format!("{line}\n"));
        }
        LogFormat::Text => warn(&format!("plyflow: {text}\n")),
    }
}

/// What of the store will be printed at the end of a run: `None` when it has nothing new to tell.
fn about_to_read(
    args: &RunArgs,
    opened: &Opened,
    session: &Session<'_>,
    summary: &Summary,
) -> Option<Depth> {
    match (stale_report(args, opened, session, summary), args.check) {
        (Some(_), _) => Some(Depth::Artifacts),
        _ if shows(args, summary) => Some(Depth::Artifacts),
        (None, true) => Some(Depth::Records),
        (None, false) => None,
    }
}

/// Whether the results are told on the screen: when there is something new.
fn shows(args: &RunArgs, summary: &Summary) -> bool {
    let worked = summary.executed + summary.failures.len() + summary.skipped > 0;
    let any = summary.executed + summary.cached > 0;
    worked && any && !args.quiet && args.log_format == LogFormat::Text
}

/// The report that has to be written because it does not tell what is.
fn stale_report(
    args: &RunArgs,
    opened: &Opened,
    session: &Session<'_>,
    summary: &Summary,
) -> Option<Utf8PathBuf> {
    let path = Some(report::beside(&opened.workflow.file, &args.until))
        .filter(|_| !args.no_report && has_news(summary))?;
    // A step that was run again to the same key (`--force`) has other costs and the same name.
    let stale = summary.executed > 0
        || !report::is_written(
            &path,
            &report::fingerprint(opened, session, &summary.failures, &path),
        );
    stale.then_some(path)
}

pub(super) fn options(args: &RunArgs, opened: &Opened) -> Result<Options, Stop> {
    let policy = match (args.keep_going, args.fail_fast) {
        (true, _) => FailurePolicy::KeepGoing,
        (_, true) => FailurePolicy::FailFast,
        _ => opened.workflow.on_failure,
    };
    let memory = match &args.memory {
        None => super::machine::default_memory(),
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
        search_path: opened.catalog.trusted_folders(),
        force: opened.step_indices(&args.force)?,
        compare: Vec::new(),
        checkpoint_interval: checkpoint_interval(&args.checkpoint_every)?,
    })
}

/// The time between checkpoints (s).
fn checkpoint_interval(text: &str) -> Result<f64, Stop> {
    let wrong = |why: String| {
        let text =
            format!("--checkpoint-every {text}: {why}; expected a time such as `30 s` or `5 min`");
        Stop::new(exit::USAGE, text)
    };
    match parse_quantity_in(text, "s") {
        Ok(seconds) if seconds >= 0.0 => Ok(seconds),
        Ok(_) => Err(wrong("it is negative".into())),
        Err(e) => Err(wrong(e.reason())),
    }
}

pub(super) fn observer(args: &RunArgs) -> Box<dyn Observer> {
    match args.log_format {
        LogFormat::Json => Box::new(JsonLines),
        LogFormat::Text if args.quiet => Box::new(Quiet),
        LogFormat::Text if std::io::stderr().is_terminal() => Box::new(Bars::default()),
        LogFormat::Text => Box::new(Lines::default()),
    }
}

/// Tells how the run went; what matters most comes last.
pub(super) fn conclude(
    args: &RunArgs,
    opened: &Opened,
    session: &Session<'_>,
    summary: &Summary,
    begun: Instant,
) -> Done {
    let verdict = tell_results(args, opened, session, summary);
    let old = of_earlier_run(
        args,
        &report::beside(&opened.workflow.file, &args.until),
        summary,
    );
    // Whoever reads along may have gone (`| head`); how the run went is told by the exit code all the same.
    let told = match args.quiet {
        true => Ok(()),
        false => tell(args, session, summary, begun, old),
    };
    if summary.interrupted {
        return Err(Stop::silent(exit::INTERRUPTED));
    }
    if let Some(first) = summary.failures.first() {
        warn(&failure_text(first, summary));
        match super::study::borne(session) {
            Some(text) => warn(&text),
            None => return Err(Stop::silent(exit::STEP_FAILED)),
        }
    }
    verdict.and(told)
}

/// Writes the report and prints the summary, both only when there is something new to tell; judges the
/// expectations when asked to.
fn tell_results(args: &RunArgs, opened: &Opened, session: &Session<'_>, summary: &Summary) -> Done {
    let stale = stale_report(args, opened, session, summary);
    let show = shows(args, summary);
    let table = study_files(args, opened);
    if stale.is_none() && !show && !args.check && table.is_none() {
        return Ok(());
    }
    let found = report::Found::read(session);
    let mut of_study = String::new();
    if let Some((csv, artifact)) = table {
        let table = super::study::Table::read(session, &found.records);
        of_study = super::study::in_short(session, &table);
        match super::study_file::write(&table, session, &csv, &artifact) {
            Ok(()) => of_study += &format!("table: {csv}, {artifact}\n"),
            // As with the report: the artifacts are whole.
            Err(e) => warn(&format!(
                "plyflow: the table of the study was not written: {e}\n"
            )),
        }
    }
    let input = report::input(
        opened,
        session,
        &found,
        &summary.failures,
        (
            &args.workflow,
            &args.until,
            &report::beside(&opened.workflow.file, &args.until),
        ),
    );
    let mut written = Some(report::beside(&opened.workflow.file, &args.until))
        .filter(|_| !args.no_report && has_news(summary));
    if let Some(path) = &stale
        && let Err(e) = plyflow_report::write_report(&input, path)
    {
        // The artifacts are whole: a report that cannot be written is no failed run.
        warn(&format!("plyflow: the report was not written: {e}\n"));
        written = None;
    }
    let told = match show {
        true => print(&(of_study + &plyflow_report::summary(&input, written.as_deref()) + "\n")),
        false => Ok(()),
    };
    checked(told, args.check, &found.rows)
}

/// The files of the study's table: at the end of every run of the whole they tell what is, also when the study has only got smaller.
fn study_files(args: &RunArgs, opened: &Opened) -> Option<(Utf8PathBuf, Utf8PathBuf)> {
    opened.workflow.study.as_ref()?;
    (args.until.is_empty()).then(|| super::study_file::beside(&opened.workflow.file))
}

/// Whether a report of a run would tell what is: one that was stopped goes on, and one without any artifact has nothing to show.
fn has_news(summary: &Summary) -> bool {
    summary.executed + summary.cached > 0 && !summary.interrupted
}

/// What to say of a report that is there although this run wrote none.
fn of_earlier_run(args: &RunArgs, report: &Utf8Path, summary: &Summary) -> Option<String> {
    let is_old = !args.no_report && !has_news(summary) && report.is_file();
    is_old.then(|| format!("the report {report} is of an earlier run\n"))
}

fn tell(
    args: &RunArgs,
    session: &Session<'_>,
    summary: &Summary,
    begun: Instant,
    old_report: Option<String>,
) -> Done {
    let wall = duration_text(begun.elapsed().as_secs_f64());
    let mut parts = vec![
        format!("{} run", summary.executed),
        format!("{} cached", summary.cached),
    ];
    for (n, word) in [
        (summary.failures.len(), "failed"),
        (summary.skipped, "not run"),
        (summary.damaged, "damaged and set aside"),
    ] {
        if n > 0 {
            parts.push(format!("{n} {word}"));
        }
    }
    let line = format!(
        "{}: {} in {wall}\n",
        one_line(&session.workflow.name),
        parts.join(", ")
    );
    if args.log_format == LogFormat::Json {
        let line = serde_json::json!({
            "event": "end", "executed": summary.executed, "cached": summary.cached,
            "failed": summary.failures.len(), "not_run": summary.skipped, "damaged": summary.damaged,
            "interrupted": summary.interrupted, "seconds": begun.elapsed().as_secs_f64(),
        });
        warn(&format!("{line}\n"));
        return Ok(());
    }
    print(&(line + &old_report.unwrap_or_default()))?;
    if summary.interrupted {
        let until = args.until.iter().map(|step| format!(" --until {step}"));
        let force = args.force.iter().filter(|step| !is_done(session, step));
        let force = force.map(|step| format!(" --force {step}"));
        print(&format!(
            "stopped; what is finished is kept. To go on: {}{}\n",
            report::command(&args.workflow),
            until.chain(force).collect::<String>()
        ))?;
    }
    Ok(())
}

/// Whether all that is known of a step has been run or found.
fn is_done(session: &Session<'_>, step: &str) -> bool {
    let core = &session.core;
    let named = core.graph().named(step);
    let of = |i: &&Instance| named.contains(&i.step);
    let mut all = core.instances().iter().filter(of).peekable();
    all.peek().is_some() && all.all(|i| matches!(i.state, State::Done { .. }))
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
        let bytes = end_of(log).unwrap_or_default();
        let text = String::from_utf8_lossy(&bytes);
        let lines: Vec<&str> = text.lines().collect();
        let tail = &lines[lines.len().saturating_sub(LOG_LINES)..];
        out += &format!("  log: {log}\n");
        for line in tail {
            out += &format!("  | {}\n", shortened(line, LONGEST_LOG_LINE));
        }
    }
    out
}

/// The last bytes of a log, of which there may be any number.
fn end_of(log: &Utf8Path) -> std::io::Result<Vec<u8>> {
    let mut file = std::fs::File::open(log)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(LOG_BYTES)))?;
    let mut bytes = Vec::new();
    file.take(LOG_BYTES).read_to_end(&mut bytes)?;
    Ok(bytes)
}

pub(super) fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::args::{Cli, Command};
    use super::*;
    use clap::Parser;

    #[test]
    fn a_report_that_a_stopped_or_failed_run_leaves_is_told_to_be_of_an_earlier_one() {
        let dir = tempfile::tempdir().unwrap();
        let report = Utf8Path::from_path(dir.path()).unwrap().join("report.html");
        let told = |words: &[&str], summary: &Summary| {
            let words = ["plyflow", "run", "w.yaml"].iter().chain(words);
            let Command::Run(args) = Cli::try_parse_from(words).unwrap().command else {
                panic!("another command");
            };
            of_earlier_run(&args, &report, summary)
        };
        let of = |executed, interrupted| Summary {
            executed,
            interrupted,
            ..Summary::default()
        };
        assert_eq!(told(&[], &of(1, true)), None, "there is none");
        std::fs::write(&report, "old").unwrap();
        let text = Some(format!("the report {report} is of an earlier run\n"));
        assert_eq!(told(&[], &of(1, true)), text);
        assert_eq!(told(&[], &of(0, false)), text, "nothing succeeded");
        assert_eq!(told(&[], &of(1, false)), None, "it was written");
        assert_eq!(told(&["--no-report"], &of(1, true)), None);
    }
}
