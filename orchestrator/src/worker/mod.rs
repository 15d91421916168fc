//! `plyflow step-worker`: one step, in a process under a supervisor. The plugin host does the work; this module sees to
//! it that the processes end when they should.

use camino::Utf8Path;
use plyflow_plugin_host::supervise;
use rustix::process::{Pid, Signal};

/// Runs the worker and ends the process. `arguments` are those after `step-worker`: the file of a job or
/// `-`, with `--parent PID` when the engine is its parent; or `--describe LIBRARY`, with the BLAKE3 that its bytes must have. `inside` is called first in the
/// process that loads libraries.
///
/// All end by `_exit`: a plugin's clean-up at exit must not turn a finished step into a crash.
///
/// # Safety
/// This process has one thread.
pub unsafe fn main(arguments: &[String], inside: impl FnOnce()) -> ! {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let work = match words[..] {
        ["--describe", library] => Work::Describe(library, None),
        ["--describe", library, hash] => Work::Describe(library, Some(hash)),
        [source] => Work::Step(source),
        [source, "--parent", parent] => match follow(parent) {
            Ok(()) => Work::Step(source),
            Err(alone) => refuse(&alone.to_string()),
        },
        _ => refuse("wants the file of a job, or - for standard input"),
    };
    let work = || match work {
        Work::Describe(library, hash) => {
            plyflow_plugin_host::describe_main(Utf8Path::new(library), hash)
        }
        // SAFETY: one thread (the caller's promise), in the child that is forked from it, too.
        Work::Step(source) => unsafe { plyflow_plugin_host::worker_main(source) },
    };
    // SAFETY: one thread (the caller's promise).
    unsafe { supervise(inside, work) }
}

/// What a worker is for.
enum Work<'a> {
    /// To tell what a library is, if its bytes have this BLAKE3.
    Describe(&'a str, Option<&'a str>),
    /// To do the job of a file.
    Step(&'a str),
}

fn refuse(text: &str) -> ! {
    crate::said::warn(&format!("plyflow step-worker: {text}\n"));
    // SAFETY: a number; what is left undone at an exit of this kind is of no use to anybody here.
    unsafe { libc::_exit(2) }
}

/// Dies when the engine dies, however it dies.
fn follow(parent: &str) -> Result<(), Alone> {
    let parent: i32 = parent.parse().map_err(|_| Alone::NoNumber)?;
    rustix::process::set_parent_process_death_signal(Some(Signal::KILL))?;
    // It may have died before the line above.
    match rustix::process::getppid() == Pid::from_raw(parent) {
        true => Ok(()),
        false => Err(Alone::Gone),
    }
}

/// Why a worker does not follow its engine.
#[derive(Debug, thiserror::Error)]
enum Alone {
    #[error("--parent wants a process number")]
    NoNumber,
    #[error("cannot follow the engine's death: {0}")]
    Refused(#[from] rustix::io::Errno),
    #[error("the engine is gone already")]
    Gone,
}
