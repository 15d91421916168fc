//! The resolved parameters.

use plyflow_mechanics::contact::ContactSettings;
use plyflow_mechanics::model::StepSettings;
use plyflow_model::artifact::Rectangle;
use plyflow_model::scene::Scene;
use serde::Deserialize;

/// A component choice as the host resolves it.
#[derive(Debug, Clone, Deserialize)]
pub struct ComponentChoice {
    /// Name or path of the plugin.
    pub plugin: String,
    /// Its resolved parameters.
    #[serde(default)]
    pub with: serde_json::Value,
}

/// Parameters of the step, SI.
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    /// The scene.
    #[serde(deserialize_with = "Scene::of_json")]
    pub scene: Scene,
    /// Element of the plies.
    pub element: ComponentChoice,
    /// Their element outside of `bending_zones`; `None`: all of them have `element`.
    #[serde(default)]
    pub element_elsewhere: Option<ComponentChoice>,
    /// Where plies have `element` if they have another one elsewhere: boxes in the undeformed plane (m), from the input `zones`.
    #[serde(skip)]
    pub bending_zones: Vec<Rectangle>,
    /// Element of the diaphragms.
    pub diaphragm_element: ComponentChoice,
    /// Ply element edge (m).
    pub element_size: f64,
    /// Diaphragm element edge (m).
    #[serde(default)]
    pub diaphragm_element_size: Option<f64>,
    /// Ratio of neighbouring diaphragm elements.
    pub diaphragm_growth: f64,
    /// Wanted step (s).
    pub time_step: f64,
    /// Share of the critical step.
    pub step_safety: f64,
    /// Least areal mass (kg/m2).
    pub least_areal_mass: f64,
    /// Mass-proportional damping (1/s).
    pub damping: f64,
    /// Contact stiffness factor.
    pub contact_stiffness: f64,
    /// Slip stiffness factor.
    pub slip_stiffness: f64,
    /// Contact damping ratio.
    pub contact_damping: f64,
    /// Contact augmentation.
    pub contact_augmentation: f64,
    /// Whether plies touch themselves.
    #[serde(default = "yes")]
    pub self_contact: bool,
    /// Frames besides the start.
    pub frames: usize,
    /// Spacing of the signed-distance grid (m).
    pub tool_grid: f64,
    /// Kinetic bound.
    pub kinetic_bound: f64,
    /// Energy unaccounted for that stops a run.
    pub drift_bound: f64,
}

fn yes() -> bool {
    true
}

impl Parameters {
    /// What controls the steps of the run.
    pub fn control(&self) -> Control {
        Control {
            frames: self.frames,
            target_step: self.time_step,
            safety: self.step_safety,
            kinetic_bound: self.kinetic_bound,
            drift_bound: self.drift_bound,
        }
    }

    /// Constants of all contacts.
    pub fn contact_settings(&self) -> ContactSettings {
        ContactSettings {
            stiffness_factor: self.contact_stiffness,
            slip_factor: self.slip_stiffness,
            damping_ratio: self.contact_damping,
            augmentation: self.contact_augmentation,
        }
    }

    /// Settings of the time integration.
    pub fn step_settings(&self) -> StepSettings {
        StepSettings {
            target_step: self.time_step,
            safety: self.step_safety,
            damping: self.damping,
        }
    }

    /// Edge of the diaphragms' elements (m).
    pub fn film_size(&self) -> f64 {
        self.diaphragm_element_size.unwrap_or(self.element_size)
    }
}

/// What controls the steps of a run, and when it is given up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Frames after the first.
    pub frames: usize,
    /// Wanted step (s).
    pub target_step: f64,
    /// Share of the critical step that is used.
    pub safety: f64,
    /// Kinetic over internal energy above which the run is marked.
    pub kinetic_bound: f64,
    /// Energy unaccounted for over the largest work so far beyond which the run stops.
    pub drift_bound: f64,
}
