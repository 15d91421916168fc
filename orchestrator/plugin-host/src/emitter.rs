//! Messages to the engine, from any thread.

use plyflow_model::job::{LogLevel, Message, Progress};
use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Progress is passed on about five times a second; a new phase sooner.
const PERIOD: Duration = Duration::from_millis(200);
const PHASE_PERIOD: Duration = Duration::from_millis(50);

pub(crate) struct Emitter<'a> {
    inner: Mutex<Inner<'a>>,
}

struct Inner<'a> {
    out: &'a mut (dyn Write + Send),
    last: Option<(Instant, String)>,
    warnings: Vec<String>,
}

impl<'a> Emitter<'a> {
    pub(crate) fn new(out: &'a mut (dyn Write + Send)) -> Self {
        Self {
            inner: Mutex::new(Inner {
                out,
                last: None,
                warnings: Vec::new(),
            }),
        }
    }

    fn inner(&self) -> MutexGuard<'_, Inner<'a>> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn log(&self, level: LogLevel, text: &str) {
        let mut inner = self.inner();
        if level == LogLevel::Warn {
            inner.warnings.push(text.to_owned());
        }
        inner.send(&Message::Log {
            level,
            text: text.to_owned(),
        });
    }

    pub(crate) fn progress(&self, progress: Progress) {
        let now = Instant::now();
        let mut inner = self.inner();
        let due = match &inner.last {
            None => true,
            Some((last, phase)) => {
                let age = now.duration_since(*last);
                age >= PERIOD || (age >= PHASE_PERIOD && *phase != progress.phase)
            }
        };
        if due {
            inner.last = Some((now, progress.phase.clone()));
            inner.send(&Message::Progress(progress));
        }
    }

    pub(crate) fn send(&self, message: &Message) {
        self.inner().send(message);
    }

    pub(crate) fn warnings(&self) -> Vec<String> {
        self.inner().warnings.clone()
    }
}

impl Inner<'_> {
    fn send(&mut self, message: &Message) {
        if let Ok(mut line) = serde_json::to_string(message) {
            line.push('\n');
            // An engine that went away cannot be told so.
            let _ = self
                .out
                .write_all(line.as_bytes())
                .and_then(|()| self.out.flush());
        }
    }
}
