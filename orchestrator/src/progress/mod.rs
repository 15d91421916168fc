//! Shows a run: bars on a terminal, lines elsewhere, JSON for programs, or nothing.

mod bars;
mod json;
mod lines;

pub use bars::Bars;
pub use json::JsonLines;
pub use lines::Lines;

use crate::engine::core::{Core, Id};
use crate::engine::{Observer, Update};
use plyflow_model::job::Progress;
use std::time::Duration;

/// Shows nothing.
pub struct Quiet;

impl Observer for Quiet {
    fn update(&mut self, _: &Core<'_>, _: Id, _: &Update<'_>) {}
}

/// `2.3 s`, `4 min 10 s`, `1 h 05 min`.
pub fn duration_text(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match whole {
        0..10 => format!("{seconds:.1} s"),
        10..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
    }
}

/// What a step says of itself in one line: simulated time, rate, energy ratio, time left.
pub fn progress_text(progress: &Progress, elapsed: Duration) -> String {
    // What matters most first: a narrow terminal cuts the end off.
    let mut parts = Vec::new();
    let done = progress.fraction.clamp(0.0, 1.0);
    if done > 0.01 && done < 1.0 {
        let left = elapsed.as_secs_f64() * (1.0 - done) / done;
        parts.push(format!("{} left", duration_text(left)));
    }
    if let Some(t) = progress.simulated_time {
        parts.push(format!("t = {t:.4} s"));
    }
    if let Some(rate) = progress.rate {
        parts.push(format!("{rate:.0} steps/s"));
    }
    if let Some(ratio) = progress.energy_ratio {
        parts.push(format!("Ek/Ei {:.2} %", 100.0 * ratio));
    }
    if !progress.phase.is_empty() {
        parts.push(progress.phase.clone());
    }
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_written_as_people_say_them() {
        assert_eq!(duration_text(2.34), "2.3 s");
        assert_eq!(duration_text(42.4), "42 s");
        assert_eq!(duration_text(250.0), "4 min 10 s");
        assert_eq!(duration_text(3900.0), "1 h 05 min");
    }

    #[test]
    fn a_progress_line_says_only_what_the_step_has() {
        let mut p = Progress {
            fraction: 0.25,
            ..Default::default()
        };
        assert_eq!(
            progress_text(&p, Duration::from_secs(20)),
            "1 min 00 s left"
        );
        p.simulated_time = Some(0.5);
        p.energy_ratio = Some(0.0123);
        let text = progress_text(&p, Duration::from_secs(1));
        assert_eq!(text, "3.0 s left, t = 0.5000 s, Ek/Ei 1.23 %");
    }
}
