//! Forming under films in time: bagging or stretching, lowering, drawing, settling.

use plyflow_mechanics::history::{MonotoneCubic, smooth_step};
use plyflow_model::STANDARD_GRAVITY;
use plyflow_model::scene::{DoubleDiaphragm, PressureCourse, SingleDiaphragm, WeightDirection};

/// Pressures and frame height of the process.
#[derive(Debug, Clone, PartialEq)]
pub struct Cycle {
    /// Name of the first phase.
    pub first: &'static str,
    /// Pressure of the surroundings over the bag's vacuum at the end (Pa). Under one film there is no bag: over vacuum.
    pub bag: f64,
    /// Its course (Pa) over the share of bagging; none: it rises smoothly in the second half.
    pub bag_course: Option<MonotoneCubic>,
    /// Pressure left in the cavity at the end (Pa).
    pub cavity_end: f64,
    /// Course of the pressure drawn (Pa) over the share of drawing; none: it comes smoothly.
    pub drawn_course: Option<MonotoneCubic>,
    /// Durations of the four phases (s).
    pub durations: [f64; 4],
    /// Frame height at start and end (m), of the mid-plane of the film that meets the bed.
    pub frame: [f64; 2],
    /// Strain by which the frame stretches the films before the bag is evacuated.
    pub pre_stretch: f64,
    /// Acceleration of free fall along z once the weight is there (m/s2); 0: bodies have no weight.
    pub weight: f64,
}

impl Cycle {
    /// From a scene that keeps its rules; `frame` as in [`Cycle::frame`].
    pub fn new(p: &DoubleDiaphragm, frame: [f64; 2]) -> Self {
        let bag = p.bag_pressure.last();
        let drawn = p.forming_pressure.last();
        Self {
            first: "bagging",
            bag,
            bag_course: course(&p.bag_pressure),
            cavity_end: (bag - drawn).max(0.0),
            drawn_course: course(&p.forming_pressure),
            durations: [
                p.bagging_time.si(),
                p.lowering_time.si(),
                p.drawing_time.si(),
                p.settling_time.si(),
            ],
            frame,
            pre_stretch: p.film_pre_stretch.0,
            weight: fall(p.weight),
        }
    }

    /// The same of a single film. The surroundings press on both of its faces until the cavity is sealed, so it does not matter over which
    /// part of stretching they come.
    pub fn of_single(p: &SingleDiaphragm, frame: [f64; 2]) -> Self {
        let drawn = p.forming_pressure.last();
        Self {
            first: "stretching",
            bag: p.surroundings.si(),
            bag_course: None,
            cavity_end: (p.surroundings.si() - drawn).max(0.0),
            drawn_course: course(&p.forming_pressure),
            durations: [
                p.stretching_time.si(),
                p.lowering_time.si(),
                p.drawing_time.si(),
                p.settling_time.si(),
            ],
            frame,
            pre_stretch: p.film_pre_stretch.0,
            weight: fall(p.weight),
        }
    }

    /// The same process, which takes `factor` times as long: every phase is stretched, and all that goes on in shares of a phase with it.
    #[must_use]
    pub fn slowed(mut self, factor: f64) -> Self {
        self.durations = self.durations.map(|d| factor * d);
        self
    }

    /// Whole duration (s).
    pub fn duration(&self) -> f64 {
        self.durations.iter().sum()
    }

    /// Time to come to rest, the last phase (s).
    pub fn settling(&self) -> f64 {
        self.durations[3]
    }

    /// When the cavity closes and drawing starts (s).
    pub fn sealed_at(&self) -> f64 {
        self.durations[0] + self.durations[1]
    }

    /// Name of the phase at `t`.
    pub fn phase(&self, t: f64) -> &'static str {
        let mut end = 0.0;
        for (d, name) in self
            .durations
            .iter()
            .zip([self.first, "lowering", "drawing"])
        {
            end += d;
            if t < end {
                return name;
            }
        }
        "settling"
    }

    /// Pressure of the surroundings over the bag at `t` (Pa).
    pub fn bag_pressure(&self, t: f64) -> f64 {
        match &self.bag_course {
            Some(course) => course.at(share(t, 0.0, self.durations[0])),
            None => self.bag * smooth_step(t, 0.5 * self.durations[0], 0.5 * self.durations[0]),
        }
    }

    /// Strain of the frame at `t`: it grows in the first half of bagging, before friction ties the films to
    /// the plies.
    pub fn stretch(&self, t: f64) -> f64 {
        self.pre_stretch * smooth_step(t, 0.0, 0.5 * self.durations[0])
    }

    /// Acceleration of free fall along z at `t` (m/s2). It grows while the frame stretches the films: under a weight that is there at
    /// once films that are still slack would fall, and swing when they are stretched.
    pub fn fall(&self, t: f64) -> f64 {
        self.weight * smooth_step(t, 0.0, 0.5 * self.durations[0])
    }

    /// Height of the frame at `t` (m).
    pub fn frame_height(&self, t: f64) -> f64 {
        let s = smooth_step(t, self.durations[0], self.durations[1]);
        self.frame[0] + (self.frame[1] - self.frame[0]) * s
    }

    /// Gas left in the cavity over that at sealing.
    pub fn gas_left(&self, t: f64) -> f64 {
        let drawn = smooth_step(t, self.sealed_at(), self.durations[2]);
        1.0 - (1.0 - self.cavity_end / self.bag.max(1e-300)) * drawn
    }

    /// Pressure (Pa) that a pump is to give the cavity at `t`: after a table, or towards a pressure that stays in it. `None` where all of the gas
    /// is drawn, or none of it: then what matters is the gas that is left, wherever its volume goes.
    pub fn wanted_in_cavity(&self, t: f64) -> Option<f64> {
        let drawn = match &self.drawn_course {
            Some(course) => course.at(share(t, self.sealed_at(), self.durations[2])),
            // A share of the gas in a cavity that shrinks to a few hundredths of itself would have far more than this pressure.
            None if self.cavity_end > 0.0 && self.cavity_end < self.bag => {
                (self.bag - self.cavity_end) * smooth_step(t, self.sealed_at(), self.durations[2])
            }
            None => return None,
        };
        Some((self.bag - drawn).max(0.0))
    }
}

/// Acceleration of free fall along z (m/s2).
fn fall(weight: Option<WeightDirection>) -> f64 {
    match weight {
        None => 0.0,
        Some(WeightDirection::Tool) => -STANDARD_GRAVITY,
        Some(WeightDirection::Away) => STANDARD_GRAVITY,
    }
}

/// Share of a phase that is over at `t`.
fn share(t: f64, start: f64, duration: f64) -> f64 {
    if duration > 0.0 {
        ((t - start) / duration).clamp(0.0, 1.0)
    } else if t >= start {
        1.0
    } else {
        0.0
    }
}

/// The course of a pressure (Pa) over the share of a phase, if a table gives it.
fn course(given: &PressureCourse) -> Option<MonotoneCubic> {
    let PressureCourse::Course(course) = given else {
        return None;
    };
    let rows = course.table.iter();
    let (times, values) = rows.map(|row| (row.share.0, row.pressure.si())).unzip();
    Some(MonotoneCubic::new(times, values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn cycle(bag: Value, forming: Value) -> Cycle {
        let process = json!({
            "frame_length": "1 m", "frame_width": "1 m", "clearance": "0.01 m", "bag_pressure": bag, "forming_pressure": forming,
            "bagging_time": "0.2 s", "lowering_time": "0.3 s", "drawing_time": "0.4 s", "settling_time": "0.1 s",
            "film_joint_margin": "0.03 m"});
        Cycle::new(&serde_json::from_value(process).unwrap(), [0.1, 0.0])
    }

    fn table(rows: &[(f64, f64)]) -> Value {
        let rows = rows
            .iter()
            .map(|(share, kpa)| json!({"share": share, "pressure": format!("{} Pa", 1e3 * kpa)}));
        json!({"table": rows.collect::<Vec<_>>()})
    }

    #[test]
    fn pressures_follow_their_tables_over_their_phases() {
        let bag = table(&[(0.0, 0.0), (0.25, 10.0), (0.5, 70.0), (1.0, 80.0)]);
        let forming = table(&[(0.0, 0.0), (0.2, 40.0), (0.6, 40.0), (1.0, 75.0)]);
        let cycle = cycle(bag, forming);
        for (t, kpa) in [
            (0.0, 0.0),
            (0.05, 10.0),
            (0.1, 70.0),
            (0.2, 80.0),
            (0.45, 80.0),
            (1.0, 80.0),
        ] {
            assert!((cycle.bag_pressure(t) - 1e3 * kpa).abs() < 1e-6, "{t}");
        }
        for (t, kpa) in [
            (0.5, 80.0),
            (0.58, 40.0),
            (0.66, 40.0),
            (0.74, 40.0),
            (0.9, 5.0),
            (1.0, 5.0),
        ] {
            let wanted = cycle.wanted_in_cavity(t).unwrap();
            assert!((wanted - 1e3 * kpa).abs() < 1e-6, "{t}: {wanted}");
        }
        assert_eq!((cycle.bag, cycle.cavity_end), (8e4, 5e3));
    }

    #[test]
    fn a_slower_process_has_the_same_states_in_a_multiple_of_the_time() {
        let forming = table(&[(0.0, 0.0), (0.2, 40.0), (1.0, 75.0)]);
        let fast = cycle(json!("80000 Pa"), forming);
        let slow = fast.clone().slowed(2.0);
        assert!((slow.duration() - 2.0).abs() < 1e-12);
        for k in 0..=20 {
            let (t, s) = (0.05 * f64::from(k), 0.1 * f64::from(k));
            let states = |c: &Cycle, t| {
                let drawn = c.wanted_in_cavity(t).unwrap();
                [c.bag_pressure(t), c.frame_height(t), c.gas_left(t), drawn]
            };
            for (a, b) in states(&fast, t).into_iter().zip(states(&slow, s)) {
                assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{t} s: {a} {b}");
            }
        }
        assert_eq!((slow.phase(0.3), slow.phase(0.5)), ("bagging", "lowering"));
    }

    #[test]
    fn single_values_come_as_smooth_steps() {
        for (forming, left) in [("80000 Pa", [0.5, 0.0]), ("0 Pa", [1.0, 1.0])] {
            let cycle = cycle(json!("80000 Pa"), json!(forming));
            for (t, bag, gas) in [
                (0.1, 0.0, 1.0),
                (0.15, 4e4, 1.0),
                (0.3, 8e4, 1.0),
                (0.7, 8e4, left[0]),
                (1.0, 8e4, left[1]),
            ] {
                let (b, g) = (cycle.bag_pressure(t), cycle.gas_left(t));
                assert!(
                    (b - bag).abs() < 1e-9 && (g - gas).abs() < 1e-12,
                    "{t} s: {b} Pa, {g}"
                );
                assert_eq!(cycle.wanted_in_cavity(t), None);
            }
        }
        // Some of the air stays: a pump sees to its pressure, however small the cavity becomes.
        let cycle = cycle(json!("80000 Pa"), json!("60000 Pa"));
        for (t, wanted) in [(0.5, 8e4), (0.7, 5e4), (0.9, 2e4), (1.0, 2e4)] {
            let w = cycle.wanted_in_cavity(t).unwrap();
            assert!((w - wanted).abs() < 1e-9, "{t} s: {w} Pa");
        }
    }

    #[test]
    fn a_single_film_is_stretched_and_then_drawn_from_the_pressure_around_it() {
        let process = json!({
            "frame_length": "1 m", "frame_width": "1 m", "clearance": "0.01 m", "forming_pressure": "60000 Pa", "surroundings": "80000 Pa",
            "stretching_time": "0.2 s", "lowering_time": "0.3 s", "drawing_time": "0.4 s", "settling_time": "0.1 s",
            "film_pre_stretch": 0.02, "weight": "tool"});
        let cycle = Cycle::of_single(&serde_json::from_value(process).unwrap(), [0.1, 0.0]);
        let names = [0.1, 0.3, 0.6, 0.95].map(|t| cycle.phase(t));
        assert_eq!(names, ["stretching", "lowering", "drawing", "settling"]);
        assert_eq!((cycle.bag, cycle.cavity_end), (8e4, 2e4));
        assert_eq!(
            (cycle.stretch(0.2), cycle.fall(0.2)),
            (0.02, -STANDARD_GRAVITY)
        );
        assert_eq!(
            (cycle.frame_height(0.2), cycle.frame_height(0.5)),
            (0.1, 0.0)
        );
        assert!((cycle.wanted_in_cavity(1.0).unwrap() - 2e4).abs() < 1e-9);
    }
}
