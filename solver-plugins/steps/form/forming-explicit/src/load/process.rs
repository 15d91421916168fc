//! What presses on a model and moves its rigid parts.

use crate::load::cycle::Cycle;
use crate::load::press::PressLoad;
use crate::load::stamping::StampingLoad;
use plyflow_mechanics::archive::{Archive, ArchiveError};
use plyflow_mechanics::backend::{self, Loaded};
use plyflow_mechanics::history::linear;
use plyflow_mechanics::model::Pressures;

/// Share of drawing's duration in which a pump makes up for what the film has moved, to within 1 / e. Far
/// longer than a span takes to snap, so that the gas that it compresses still catches it.
const PUMP_LAG: f64 = 0.05;

/// Where pressures come from.
pub enum Load {
    /// The process itself; the cavity is a gas of prescribed mass, isothermal: p V = n R T. With a table of the pressure drawn, or where
    /// some of the air stays, a pump changes that mass.
    Process {
        /// Phases.
        cycle: Cycle,
        /// Volume of the tool (m3), taken off the volume under the film.
        tool_volume: f64,
        /// Volume of the cavity at sealing (m3), once it is known.
        sealed_volume: Option<f64>,
        /// Volume (m3) at which the gas that the pump has left would have the wanted pressure; follows the cavity's.
        pumped_volume: Option<f64>,
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
    /// The parts and grippers of a stamping.
    Stamping(StampingLoad),
}

impl Load {
    /// When the run begins (s): 0, or where what drives it does.
    pub fn start(&self) -> f64 {
        match self {
            Self::Given { time, .. } => time[0],
            Self::Press(p) => p.begin,
            Self::Stamping(s) => s.begin,
            Self::Process { .. } => 0.0,
        }
    }

    /// When the process ends (s).
    pub fn duration(&self) -> f64 {
        match self {
            Self::Process { cycle, .. } | Self::Given { cycle, .. } => cycle.duration(),
            Self::Press(p) => p.stroke.forming + p.stroke.settling,
            Self::Stamping(s) => s.forming + s.settling,
        }
    }

    /// Time to come to rest at the end (s).
    pub fn settling(&self) -> f64 {
        match self {
            Self::Process { cycle, .. } | Self::Given { cycle, .. } => cycle.settling(),
            Self::Press(p) => p.stroke.settling,
            Self::Stamping(s) => s.settling,
        }
    }

    /// Name of the phase at `t`.
    pub fn phase(&self, t: f64) -> &'static str {
        match self {
            Self::Process { cycle, .. } | Self::Given { cycle, .. } => cycle.phase(t),
            Self::Press(p) if t < p.stroke.forming => "forming",
            Self::Stamping(s) if t < s.forming => "forming",
            Self::Press(_) | Self::Stamping(_) => "settling",
        }
    }

    /// Height of the frame at `t` (m); of a press's punch over its end, of the tool of a stamping over where it is drawn.
    pub fn frame_height(&self, t: f64) -> f64 {
        match self {
            Self::Process { cycle, .. } => cycle.frame_height(t),
            Self::Given { time, frame, .. } => linear(time, frame, t),
            Self::Press(p) => -p.stroke.left(t),
            Self::Stamping(s) => s.tool_height(t),
        }
    }

    /// The press, when it is one.
    pub fn press(&self) -> Option<&PressLoad> {
        match self {
            Self::Press(p) => Some(p),
            _ => None,
        }
    }

    /// The stamping, when it is one.
    pub fn stamping(&self) -> Option<&StampingLoad> {
        match self {
            Self::Stamping(s) => Some(s),
            _ => None,
        }
    }

    /// Whether rigid parts move, and nothing is between films.
    pub fn moves_parts(&self) -> bool {
        matches!(self, Self::Press(_) | Self::Stamping(_))
    }

    /// What it remembers of the run.
    pub fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        match self {
            Self::Process {
                sealed_volume,
                pumped_volume,
                ..
            } => {
                a.value(sealed_volume)?;
                a.value(pumped_volume)
            }
            Self::Given { .. } => Ok(()),
            Self::Press(p) => p.archive(a),
            Self::Stamping(s) => s.archive(a),
        }
    }
}

impl backend::Load for Load {
    /// Sets pressures and weight, or the places of the press's parts, for the time `t` (s).
    fn apply(&mut self, on: &mut dyn Loaded, t: f64) {
        if let Self::Process { cycle, .. } | Self::Given { cycle, .. } = self {
            // Of the bodies' own masses: what mass scaling adds has no weight.
            on.set_body_acceleration([0.0, 0.0, cycle.fall(t)]);
        }
        match self {
            Self::Press(p) => p.apply(on, t),
            Self::Stamping(s) => s.apply(on, t),
            Self::Given {
                time, cavity, bag, ..
            } => {
                on.set_pressures(Pressures {
                    below: linear(time, cavity, t),
                    above: linear(time, bag, t),
                });
            }
            Self::Process {
                cycle,
                tool_volume,
                sealed_volume,
                pumped_volume,
            } => {
                let above = cycle.bag_pressure(t);
                let mut below = above;
                if t >= cycle.sealed_at() {
                    // Measured anew in every step: a pressure that lags behind the volume is a spring with
                    // negative damping, and the light film would shake itself to pieces on it.
                    let volume = on.volume_below() - *tool_volume;
                    let v0 = *sealed_volume.get_or_insert(volume.max(1e-9));
                    // The facets of the film may cut into the tool: the gas is never squeezed below half a
                    // per cent of its volume. More than 1.2 times the surroundings would lift the seal.
                    let volume = volume.max(0.005 * v0);
                    below = match cycle.wanted_in_cavity(t) {
                        None => cycle.bag * cycle.gas_left(t) * v0 / volume,
                        Some(wanted) => {
                            let left = pumped_volume.get_or_insert(volume);
                            let lag = PUMP_LAG * cycle.durations[2];
                            *left += (volume - *left) * on.step_size() / (lag + on.step_size());
                            wanted * *left / volume
                        }
                    };
                    below = below.min(1.2 * cycle.bag);
                }
                on.set_pressures(Pressures { below, above });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_the_pump_has_left_is_kept_in_a_checkpoint() {
        let process = json!({
            "frame_length": "1 m", "frame_width": "1 m", "clearance": "0.01 m", "bag_pressure": "80000 Pa",
            "forming_pressure": {"table": [{"share": 0.0, "pressure": "0 Pa"}, {"share": 1.0, "pressure": "60000 Pa"}]},
            "bagging_time": "0.2 s", "lowering_time": "0.3 s", "drawing_time": "0.4 s", "settling_time": "0.1 s",
            "film_joint_margin": "0.03 m"});
        let process = serde_json::from_value(process).unwrap();
        let load = |sealed_volume, pumped_volume| Load::Process {
            cycle: Cycle::new(&process, [0.1, 0.0]),
            tool_volume: 1e-3,
            sealed_volume,
            pumped_volume,
        };
        let mut bytes = Vec::new();
        load(Some(0.3), Some(0.2))
            .archive(&mut Archive::Save(&mut bytes))
            .unwrap();
        let mut again = load(None, None);
        again.archive(&mut Archive::Load(&bytes)).unwrap();
        let Load::Process {
            sealed_volume,
            pumped_volume,
            ..
        } = again
        else {
            unreachable!()
        };
        assert_eq!((sealed_volume, pumped_volume), (Some(0.3), Some(0.2)));
    }
}
