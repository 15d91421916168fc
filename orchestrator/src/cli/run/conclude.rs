//! The end of a run: its report, its table, its summary and its exit code.

use crate::advice;
use crate::cli::args::{LogFormat, RunArgs};
use crate::cli::found::points::Table;
use crate::cli::found::rows::Found;
use crate::cli::open::Opened;
use crate::cli::results::checked;
use crate::cli::table::first_line;
use crate::cli::typed::command;
use crate::cli::{report, study, study_file};
use crate::engine::core::{Instance, State};
use crate::engine::{Depth, Failure, Session, Summary};
use crate::exit;
use crate::progress::duration_text;
use crate::said::{Done, Stop, print, warn};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::text::{one_line, shortened};
use plyflow_workflow::resolved::StudyPoint;
use std::collections::BTreeSet;
use std::io::{Read, Seek, SeekFrom};
use std::time::Instant;

/// Lines of a failed step's log that are shown.
const LOG_LINES: usize = 15;

/// Bytes at the end of it among which these are.
const LOG_BYTES: u64 = 64 << 10;

/// Characters of each that are shown.
const LONGEST_LOG_LINE: usize = 2000;

/// What of the store will be printed at the end of a run: `None` when it has nothing new to tell.
pub fn about_to_read(
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

/// Tells how the run went; what matters most comes last.
pub fn conclude(
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
        match borne(session) {
            Some(text) => warn(&text),
            None => return Err(Stop::silent(exit::STEP_FAILED)),
        }
    }
    verdict.and(told)
}

/// What a study bears of the failures of a run, in words; `None`: it does not.
fn borne(session: &Session<'_>) -> Option<String> {
    let study = session.workflow.study.as_ref()?;
    if study.optimisation.is_some() {
        return Some("what fails at a point is an answer to an optimisation\n".into());
    }
    let most = study.at_most_failures? as usize;
    let core = &session.core;
    let failed: BTreeSet<usize> = (0..core.instances().len())
        .filter(|id| core.instances()[*id].state == State::Failed)
        .map(|id| core.instances()[id].step)
        .collect();
    let is_failed = |p: &&StudyPoint| p.steps.iter().any(|s| failed.contains(s));
    let n = study.points.iter().filter(is_failed).count();
    let points = study.points.len();
    (n <= most).then(|| {
        format!(
            "{n} of {points} points failed; the study bears {most} (`at_most_failures`), so that this run ends well\n"
        )
    })
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
    let found = Found::read(session);
    let mut of_study = String::new();
    if let Some((csv, artifact)) = table {
        let table = Table::read(session, &found.records);
        of_study = study::in_short(session, &table);
        match study_file::write(&table, session, &csv, &artifact) {
            Ok(()) => of_study += &format!("table: {csv}, {artifact}\n"),
            // As with the report: the artifacts are whole.
            Err(e) => warn(&format!(
                "plyflow: the table of the study was not written: {}\n",
                advice::with(&e.to_string())
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
        let text = advice::with(&e.to_string());
        warn(&format!("plyflow: the report was not written: {text}\n"));
        written = None;
    }
    let told = match show {
        true => print(&(of_study + &plyflow_report::summary(&input, written.as_deref()) + "\n")),
        false => Ok(()),
    };
    checked(told, args.check, &found.rows, &input.judged)
}

/// The files of the study's table: at the end of every run of the whole they tell what is, also when the study has only got smaller.
fn study_files(args: &RunArgs, opened: &Opened) -> Option<(Utf8PathBuf, Utf8PathBuf)> {
    opened.workflow.study.as_ref()?;
    (args.until.is_empty()).then(|| study_file::beside(&opened.workflow.file))
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
            command(&args.workflow),
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
        advice::with(&first.reason).replace('\n', "\n  ")
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::{Cli, Command};
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
