//! With what a run works, as its command line says.

use crate::cli::args::{LogFormat, RunArgs};
use crate::cli::machine::default_memory;
use crate::cli::open::{Opened, cores};
use crate::engine::core::Limits;
use crate::engine::{Observer, Options};
use crate::exit;
use crate::progress::{Bars, JsonLines, Lines, Quiet};
use crate::said::Stop;
use plyflow_model::units::parse_quantity_in;
use plyflow_workflow::resolved::FailurePolicy;
use std::io::IsTerminal;

/// How often what turns out to be damaged at the end of a run is made again.
pub const ROUNDS: usize = 2;

/// What a session of this run works with.
///
/// # Errors
/// When an option is not understood or names no step.
pub fn options(args: &RunArgs, opened: &Opened) -> Result<Options, Stop> {
    let policy = match (args.keep_going, args.fail_fast) {
        (true, _) => FailurePolicy::KeepGoing,
        (_, true) => FailurePolicy::FailFast,
        _ => opened.workflow.on_failure,
    };
    let memory = match &args.memory {
        None => default_memory(),
        Some(text) => {
            text.parse::<plyflow_model::workflow::Memory>()
                .map_err(|e| Stop::new(exit::USAGE, format!("--memory {text}: {e}")))?
                .0
        }
    };
    // On a cluster everything that is ready is given away at once: there it is counted.
    let (cores, memory) = match args.on {
        Some(_) => (u32::MAX, 0),
        None => (args.jobs.unwrap_or_else(cores), memory),
    };
    Ok(Options {
        limits: Limits {
            cores,
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

/// Who shows this run.
pub fn observer(args: &RunArgs) -> Box<dyn Observer> {
    match args.log_format {
        LogFormat::Json => Box::new(JsonLines),
        LogFormat::Text if args.quiet => Box::new(Quiet),
        LogFormat::Text if std::io::stderr().is_terminal() => Box::new(Bars::default()),
        LogFormat::Text => Box::new(Lines::default()),
    }
}
