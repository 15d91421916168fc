//! How far a step is and how long it takes, in words.

use plyflow_model::job::Progress;
use std::time::Instant;

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

/// How fast a step gets on: counted from the first sign of progress, because one that goes on from a checkpoint begins
/// far along.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pace(Option<(Instant, f64)>);

impl Pace {
    /// Time left (s) at `now` with this part done (0..1), once there is something to tell it from.
    pub fn left(&mut self, fraction: f64, now: Instant) -> Option<f64> {
        let done = fraction.clamp(0.0, 1.0);
        if done <= 0.0 {
            return None;
        }
        let (begun, from) = *self.0.get_or_insert((now, done));
        let way = done - from;
        let elapsed = now.saturating_duration_since(begun).as_secs_f64();
        (way > 0.01 && done < 1.0).then(|| elapsed * (1.0 - done) / way)
    }
}

/// What a step says of itself in one line: time left (s), simulated time, rate, energy ratio.
pub fn progress_text(progress: &Progress, left: Option<f64>) -> String {
    // What matters most first: a narrow terminal cuts the end off.
    let mut parts = Vec::new();
    if let Some(left) = left {
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
    use std::time::Duration;

    #[test]
    fn durations_are_written_as_people_say_them() {
        assert_eq!(duration_text(2.34), "2.3 s");
        assert_eq!(duration_text(42.4), "42 s");
        assert_eq!(duration_text(250.0), "4 min 10 s");
        assert_eq!(duration_text(3900.0), "1 h 05 min");
    }

    #[test]
    fn a_progress_line_says_only_what_the_step_has() {
        let mut p = Progress::default();
        assert_eq!(progress_text(&p, Some(60.0)), "1 min 00 s left");
        p.simulated_time = Some(0.5);
        p.energy_ratio = Some(0.0123);
        let text = progress_text(&p, Some(3.0));
        assert_eq!(text, "3.0 s left, t = 0.5000 s, Ek/Ei 1.23 %");
    }

    #[test]
    fn the_time_left_of_a_step_that_goes_on_is_told_from_what_this_attempt_did() {
        let start = Instant::now();
        let at = |s: u64| start + Duration::from_secs(s);
        let mut fresh = Pace::default();
        assert_eq!(
            [fresh.left(0.0, at(0)), fresh.left(0.005, at(1))],
            [None, None]
        );
        assert_eq!(fresh.left(0.505, at(101)), Some(99.0));
        let mut resumed = Pace::default();
        assert_eq!(
            [resumed.left(0.0, at(0)), resumed.left(0.4, at(1))],
            [None, None]
        );
        assert_eq!(resumed.left(0.7, at(31)).map(f64::round), Some(30.0));
        assert_eq!(resumed.left(1.0, at(61)), None);
    }
}
