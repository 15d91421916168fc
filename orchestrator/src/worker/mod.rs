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
pub fn main(arguments: &[String], inside: impl FnOnce()) -> ! {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["--describe", library] => describe(inside, library, None),
        ["--describe", library, hash] => describe(inside, library, Some(hash)),
        [source] => supervise(inside, || plyflow_plugin_host::worker_main(source)),
        [source, "--parent", parent] => match follow(parent) {
            Ok(()) => supervise(inside, || plyflow_plugin_host::worker_main(source)),
            Err(alone) => refuse(&alone.to_string()),
        },
        _ => refuse("wants the file of a job, or - for standard input"),
    }
}

fn describe(inside: impl FnOnce(), library: &str, hash: Option<&str>) -> ! {
    supervise(inside, || {
        plyflow_plugin_host::describe_main(Utf8Path::new(library), hash)
    })
}

fn refuse(text: &str) -> ! {
    crate::said::warn(&format!("plyflow step-worker: {text}\n"));
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
