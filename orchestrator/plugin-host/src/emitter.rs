//! Messages to the engine, from any thread.

use plyflow_model::job::{LogLevel, Message, Progress};
use plyflow_model::text::shortened;
use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Progress is passed on about five times a second; a new phase sooner.
const PERIOD: Duration = Duration::from_millis(200);
const PHASE_PERIOD: Duration = Duration::from_millis(50);

/// Longest text of a plugin that is passed on (characters): its beginning and end say what there is to say.
pub(crate) const LONGEST_TEXT: usize = 20_000;
/// Most warnings that are kept with an artifact; all are in the log.
const MOST_WARNINGS: usize = 500;

pub(crate) struct Emitter<'a> {
    inner: Mutex<Inner<'a>>,
}

struct Inner<'a> {
    out: &'a mut (dyn Write + Send),
    last: Option<(Instant, String)>,
    warnings: Vec<String>,
    /// Warnings that came after the last one that is kept.
    more: usize,
}

impl<'a> Emitter<'a> {
    pub(crate) fn new(out: &'a mut (dyn Write + Send)) -> Self {
        Self {
            inner: Mutex::new(Inner {
                out,
                last: None,
                warnings: Vec::new(),
                more: 0,
            }),
        }
    }

    fn inner(&self) -> MutexGuard<'_, Inner<'a>> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn log(&self, level: LogLevel, text: &str) {
        let mut inner = self.inner();
        let text = shortened(text, LONGEST_TEXT);
        if level == LogLevel::Warn {
            match inner.warnings.len() < MOST_WARNINGS {
                true => inner.warnings.push(text.to_string()),
                false => inner.more += 1,
            }
        }
        inner.send(&Message::Log {
            level,
            text: text.into_owned(),
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
        let inner = self.inner();
        let mut all = inner.warnings.clone();
        if inner.more > 0 {
            all.push(format!("{} more warnings are in the log alone", inner.more));
        }
        all
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_plugin_says_is_of_bounded_length_and_number() {
        let mut out = Vec::new();
        let emitter = Emitter::new(&mut out);
        emitter.log(LogLevel::Warn, &"x".repeat(50_000_000));
        for _ in 0..2000 {
            emitter.log(LogLevel::Warn, "again");
        }
        let kept = emitter.warnings();
        assert_eq!(kept.len(), MOST_WARNINGS + 1);
        assert!(kept[0].chars().count() < LONGEST_TEXT + 100);
        let last = kept.last().unwrap();
        assert_eq!(last, "1501 more warnings are in the log alone");
        assert!(out.len() < 2_000_000);
    }
}
