//! What is said: the only way of text to the terminal, and how a command ends.

use crate::exit;
use plyflow_model::text::safe;
use std::fmt::Display;
use std::io::{IsTerminal, Write as _};

/// An end of a command that is not success: what to say and the exit code.
#[derive(Debug)]
pub struct Stop {
    /// One of [`exit`].
    pub code: u8,
    /// For the user; empty when all has been said.
    pub text: String,
}

impl Stop {
    /// A stop with a text.
    pub fn new(code: u8, text: impl Display) -> Self {
        Self {
            code,
            text: text.to_string(),
        }
    }

    /// A stop after everything has been said.
    pub fn silent(code: u8) -> Self {
        Self {
            code,
            text: String::new(),
        }
    }

    /// Wraps an error of the machine with what was being done.
    pub fn machine<E: Display>(what: impl Display) -> impl FnOnce(E) -> Self {
        move |e| Self::new(exit::INTERNAL, format!("{what}: {e}"))
    }
}

/// What a command ends with.
pub type Done = Result<(), Stop>;

/// Prints to standard output, with what could steer a terminal made visible; a reader that has gone away (`| head`) ends the command quietly.
pub fn print(text: &str) -> Done {
    let mut out = std::io::stdout().lock();
    match out
        .write_all(safe(text).as_bytes())
        .and_then(|()| out.flush())
    {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Err(Stop::silent(exit::OK)),
        Err(e) => Err(Stop::machine("standard output")(e)),
        Ok(()) => Ok(()),
    }
}

/// Writes to standard error, with what could steer a terminal made visible. Whoever reads may have gone, the disk may be full: what happened is told by the exit code all the same.
pub fn warn(text: &str) {
    let _ = std::io::stderr().lock().write_all(safe(text).as_bytes());
}

/// Shows findings in colours on a terminal. Their own text has been made safe, the colours have not.
pub fn show_findings(findings: &plyflow_workflow::Diagnostics) {
    let text = findings.render(std::io::stderr().is_terminal());
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}
