//! `plyflow step-worker`: one process, one step. The plugin host does the work; this module sees to it that
//! the process ends when it should.

use camino::Utf8Path;
use rustix::process::{Pid, Signal};

/// Runs the worker and ends the process. `arguments` are those after `step-worker`: the file of a job or
/// `-`, with `--parent PID` when the engine is its parent; or `--describe LIBRARY`.
pub fn main(arguments: &[String]) -> ! {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let code = match words[..] {
        ["--describe", library] => plyflow_plugin_host::describe_main(Utf8Path::new(library)),
        [source] => plyflow_plugin_host::worker_main(source),
        [source, "--parent", parent] => match follow(parent) {
            Ok(()) => plyflow_plugin_host::worker_main(source),
            Err(text) => refuse(&text),
        },
        _ => refuse("wants the file of a job, or - for standard input"),
    };
    // Not `std::process::exit`: a plugin's clean-up at exit must not turn a finished step into a crash.
    unsafe { libc::_exit(code) }
}

fn refuse(text: &str) -> i32 {
    eprintln!("plyflow step-worker: {text}");
    2
}

/// Dies when the engine dies, however it dies.
fn follow(parent: &str) -> Result<(), String> {
    let parent: i32 = parent
        .parse()
        .map_err(|_| "--parent wants a process number")?;
    rustix::process::set_parent_process_death_signal(Some(Signal::KILL))
        .map_err(|e| format!("cannot follow the engine's death: {e}"))?;
    // It may have died before the line above.
    if rustix::process::getppid() != Pid::from_raw(parent) {
        return Err("the engine is gone already".into());
    }
    Ok(())
}
