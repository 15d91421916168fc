//! Processes in time. Double-diaphragm forming: bagging, lowering, drawing, settling; a press: forming, settling.

use crate::press::PressLoad;
use plyflow_mechanics::archive::{Archive, ArchiveError};
use plyflow_mechanics::history::{linear, smooth_step};
use plyflow_mechanics::model::{Drive, Model, Pressures};
use plyflow_mechanics::vec3::V;
use plyflow_model::scene::{DoubleDiaphragm, WeightDirection};

/// Free fall (m/s2).
pub(crate) const GRAVITY: f64 = 9.81;

/// Pressures and frame height of the process.
#[derive(Debug, Clone, PartialEq)]
pub struct Cycle {
    /// Pressure of the surroundings over the bag's vacuum (Pa).
    pub bag: f64,
    /// Pressure left in the cavity at the end (Pa).
    pub cavity_end: f64,
    /// Durations of the four phases (s).
    pub durations: [f64; 4],
    /// Frame height at start and end (m), of the lower film's mid-plane.
    pub frame: [f64; 2],
    /// Strain by which the frame stretches the films before the bag is evacuated.
    pub pre_stretch: f64,
    /// Acceleration of free fall along z once the weight is there (m/s2); 0: bodies have no weight.
    pub weight: f64,
}

impl Cycle {
    /// From the scene; `frame` as in [`Cycle::frame`].
    pub fn new(p: &DoubleDiaphragm, frame: [f64; 2]) -> Self {
        Self {
            bag: p.bag_pressure.si(),
            cavity_end: (p.bag_pressure.si() - p.forming_pressure.si()).max(0.0),
            durations: [
                p.bagging_time.si(),
                p.lowering_time.si(),
                p.drawing_time.si(),
                p.settling_time.si(),
            ],
            frame,
            pre_stretch: p.film_pre_stretch.0,
            weight: match p.weight {
                None => 0.0,
                Some(WeightDirection::Tool) => -GRAVITY,
                Some(WeightDirection::Away) => GRAVITY,
            },
        }
    }

    /// Whole duration (s).
    pub fn duration(&self) -> f64 {
        self.durations.iter().sum()
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
            .zip(["bagging", "lowering", "drawing"])
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
        self.bag * smooth_step(t, 0.5 * self.durations[0], 0.5 * self.durations[0])
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
}

/// Stretches the films, then moves the frame straight down.
pub struct FrameDrive {
    /// `[k]` x, y of the frame's nodes (m).
    pub plan: Vec<[f64; 2]>,
    /// The process.
    pub cycle: Cycle,
}

impl Drive for FrameDrive {
    fn position(&self, k: usize, t: f64) -> V {
        let s = 1.0 + self.cycle.stretch(t);
        [
            s * self.plan[k][0],
            s * self.plan[k][1],
            self.cycle.frame_height(t),
        ]
    }
}

/// Where pressures come from.
pub enum Load {
    /// The process itself; the cavity is a gas of prescribed mass, isothermal: p V = n R T.
    Process {
        /// Phases.
        cycle: Cycle,
        /// Volume of the tool (m3), taken off the volume under the film.
        tool_volume: f64,
        /// Volume of the cavity at sealing (m3), once it is known.
        sealed_volume: Option<f64>,
    },
    /// Histories of the run that drives this one.
    Given {
        /// Times (s).
        time: Vec<f64>,
        /// Cavity pressure (Pa).
        cavity: Vec<f64>,
        /// Bag pressure (Pa).
        bag: Vec<f64>,
        /// Frame height (m).
        frame: Vec<f64>,
        /// Phases, for names and the end.
        cycle: Cycle,
    },
    /// Punch and holder of a press.
    Press(PressLoad),
}

impl Load {
    /// When the run begins (s): 0, or where what drives it does.
    pub fn start(&self) -> f64 {
        match self {
            Self::Given { time, .. } => time[0],
            _ => 0.0,
        }
    }

    /// When the process ends (s).
    pub fn duration(&self) -> f64 {
        match self {
            Self::Process { cycle, .. } | Self::Given { cycle, .. } => cycle.duration(),
            Self::Press(p) => p.stroke.forming + p.stroke.settling,
        }
    }

    /// Name of the phase at `t`.
    pub fn phase(&self, t: f64) -> &'static str {
        match self {
            Self::Process { cycle, .. } | Self::Given { cycle, .. } => cycle.phase(t),
            Self::Press(p) if t < p.stroke.forming => "forming",
            Self::Press(_) => "settling",
        }
    }

    /// Height of the frame at `t` (m); of a press's punch over its end.
    pub fn frame_height(&self, t: f64) -> f64 {
        match self {
            Self::Process { cycle, .. } => cycle.frame_height(t),
            Self::Given { time, frame, .. } => linear(time, frame, t),
            Self::Press(p) => -p.stroke.left(t),
        }
    }

    /// The press, when it is one.
    pub fn press(&self) -> Option<&PressLoad> {
        match self {
            Self::Press(p) => Some(p),
            _ => None,
        }
    }

    /// What it remembers of the run.
    pub(crate) fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        match self {
            Self::Process { sealed_volume, .. } => a.value(sealed_volume),
            Self::Given { .. } => Ok(()),
            Self::Press(p) => p.archive(a),
        }
    }

    /// Sets the model's pressures and weight, or the places of the press's parts, for its present time.
    pub fn apply(&mut self, model: &mut Model) {
        let t = model.time;
        if let Self::Process { cycle, .. } | Self::Given { cycle, .. } = self {
            // Of the bodies' own masses: what mass scaling adds has no weight.
            model.body_acceleration[2] = cycle.fall(t);
        }
        match self {
            Self::Press(p) => p.apply(model),
            Self::Given {
                time, cavity, bag, ..
            } => {
                model.pressures = Pressures {
                    below: linear(time, cavity, t),
                    above: linear(time, bag, t),
                };
            }
            Self::Process {
                cycle,
                tool_volume,
                sealed_volume,
            } => {
                let above = cycle.bag_pressure(t);
                let mut below = above;
                if t >= cycle.sealed_at() {
                    // Measured anew in every step: a pressure that lags behind the volume is a spring with
                    // negative damping, and the light film would shake itself to pieces on it.
                    let volume = model.volume_below() - *tool_volume;
                    let v0 = *sealed_volume.get_or_insert(volume.max(1e-9));
                    // The facets of the film may cut into the tool: the gas is never squeezed below half a
                    // per cent of its volume. More than 1.2 times the surroundings would lift the seal.
                    below = cycle.bag * cycle.gas_left(t) * v0 / volume.max(0.005 * v0);
                    below = below.min(1.2 * cycle.bag);
                }
                model.pressures = Pressures { below, above };
            }
        }
    }
}
