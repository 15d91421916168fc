//! The interpreter that runs the step.

use crate::serve::End;
use plyflow_sdk::StepError;
use serde::Deserialize;
use std::io;
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

/// The file beside the library that says with what it was made. It is not part of the library, because a path says nothing of what a step does.
const BESIDE: &str = "python.json";

/// What the interpreter does first: it forgets the folder where one happens to stand.
const BEGIN: &str = "import sys; sys.path[:] = [p for p in sys.path if p]; from plyflow._step_process import main; main()";

#[derive(Deserialize)]
struct Beside {
    /// The interpreter.
    interpreter: String,
    /// The folder that holds the package `plyflow`.
    package: String,
}

/// A running interpreter.
pub struct Child {
    process: std::process::Child,
    interpreter: String,
    /// Its end of the conversation.
    pub stream: UnixStream,
}

impl Child {
    /// Starts the interpreter by which the library was made.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(library: &Path) -> Result<Self, StepError> {
        let beside = library.with_file_name(BESIDE);
        let read = std::fs::read(&beside).map_err(|e| e.to_string());
        let beside: Beside = read
            .and_then(|text| serde_json::from_slice(&text).map_err(|e| e.to_string()))
            .map_err(|e| {
                let text = format!(
                    "{}, which says by which interpreter the step was made, cannot be read: {e}",
                    beside.display()
                );
                StepError::Failed(text)
            })?;
        let interpreter = beside.interpreter;
        let failed = |e: io::Error| {
            StepError::Failed(format!(
                "the interpreter {interpreter}, by which this step was made, cannot be started: {e}. Install it again, or set PLYFLOW_PYTHON to another one and run again"
            ))
        };
        let (ours, theirs) = UnixStream::pair().map_err(failed)?;
        let theirs = OwnedFd::from(theirs);
        keep_over_exec(&theirs).map_err(failed)?;
        let mut command = Command::new(&interpreter);
        // Where one happens to stand, and what the environment says of packages, does not decide what a step does.
        command
            .args(["-B", "-c", BEGIN])
            .arg(theirs.as_raw_fd().to_string())
            .env("PYTHONPATH", &beside.package)
            .env_remove("PYTHONSTARTUP")
            .env_remove("PYTHONHOME")
            .env("PYTHONHASHSEED", "0")
            .stdin(Stdio::null());
        let process = command.spawn().map_err(failed)?;
        Ok(Self {
            process,
            interpreter,
            stream: ours,
        })
    }

    /// Waits for the interpreter and says how the step ended.
    ///
    /// # Errors
    /// As the step failed, or was stopped.
    pub fn conclude(mut self, end: io::Result<End>) -> Result<(), StepError> {
        drop(self.stream);
        if end.is_err() {
            let _ = self.process.kill();
        }
        let status = self.process.wait();
        match end {
            Ok(End::Done) => Ok(()),
            Ok(End::Cancelled) => Err(StepError::Cancelled),
            Ok(End::Failed(text)) => Err(StepError::Failed(text)),
            Ok(End::Lost) => Err(StepError::Failed(match status {
                Ok(status) => lost(&self.interpreter, status),
                Err(e) => format!("{} cannot be waited for: {e}", self.interpreter),
            })),
            Err(e) => Err(StepError::Failed(format!(
                "the conversation with {} broke off: {e}",
                self.interpreter
            ))),
        }
    }
}

fn lost(interpreter: &str, status: ExitStatus) -> String {
    let how = match (status.signal(), status.code()) {
        (Some(libc::SIGKILL), _) => {
            "was killed (signal 9); the system does so when memory is short".to_owned()
        }
        (Some(signal), _) => format!("was ended by signal {signal}"),
        (None, Some(code)) => format!("ended with code {code}"),
        (None, None) => "ended".to_owned(),
    };
    format!("{interpreter} {how} before the step was done; the log has what it printed")
}

/// Lets a new program have this descriptor. The process that calls has one thread, so that no other one is started meanwhile.
fn keep_over_exec(fd: &OwnedFd) -> io::Result<()> {
    // SAFETY: numbers alone.
    match unsafe { libc::fcntl(fd.as_raw_fd(), libc::F_SETFD, 0) } {
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}
