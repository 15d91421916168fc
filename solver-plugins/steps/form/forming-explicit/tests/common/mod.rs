//! What the tests of whole runs share: components without a host, scenes, the run itself. No test uses all of it.
#![allow(dead_code)]

pub mod cut;
pub mod depth;
pub mod scenes;

use plyflow_abi::{PF_KIND_ELEMENT, PF_KIND_MATERIAL, pf_component};
use plyflow_forming_explicit::{
    Components, Forming, FormingError, Observer, Outcome, Parameters, build_global,
};
use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_kernels::built_in;
use plyflow_mechanics::energy::Ledger;
use plyflow_sdk::StepError;
use serde_json::{Value, json};
use std::cell::Cell;

/// The components that come along with Plyflow.
pub struct BuiltIn;

impl BuiltIn {
    fn of(kind: u32, name: &str) -> Result<pf_component, FormingError> {
        let found = built_in::component(kind, name);
        found.ok_or_else(|| FormingError::value("component", name, "one that comes along"))
    }
}

// SAFETY: Plyflow's own, which are static.
unsafe impl Components for BuiltIn {
    fn element(&self, name: &str) -> Result<pf_component, FormingError> {
        Self::of(PF_KIND_ELEMENT, name)
    }
    fn material(&self, name: &str) -> Result<pf_component, FormingError> {
        Self::of(PF_KIND_MATERIAL, name)
    }
}

/// Follows a run without a word.
pub struct Silent;

impl Observer for Silent {
    fn frame(&mut self, _: &Forming, _: f64) -> Result<(), StepError> {
        Ok(())
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
}

/// The non-crimp fabric, its fibres made softer for the step.
pub fn fabric() -> Value {
    json!({
        "plyflow_material": 1, "name": "NCF", "plugin": "material-fabric",
        "thickness": "0.0004 m", "areal_mass": "0.44 kg/m2",
        "with": {
            "form": "fibre-energy", "fibre_modulus": 3e9, "compression_factor": 1.0,
            "shear": {"coefficients": [0.0, 112.19, 94.73, 137.06, -65.56, 29.56], "limit": 1.05},
            "stitch": {"angles": [0.06, 0.5, 0.75], "forces": [0.0, 880.0, 0.0]}
        }
    })
}

/// A woven fabric: the same for both signs of shear, both families and both signs of bending.
pub fn woven() -> Value {
    json!({
        "plyflow_material": 1, "name": "woven", "plugin": "material-fabric",
        "thickness": "0.0003 m", "areal_mass": "0.21 kg/m2",
        "with": {
            "form": "fibre-energy", "fibre_modulus": 3e9, "compression_factor": 1.0,
            "shear": {"coefficients": [0.0, 60.0, 0.0, 40.0], "limit": 1.05},
            "bending": {"positive": {"linear": 1e-4, "asymptote": 0.01, "scale": 20.0},
                        "negative": {"linear": 1e-4, "asymptote": 0.01, "scale": 20.0}}
        }
    })
}

/// Gives a run one, two and three threads in turn.
#[derive(Debug, Default)]
pub struct ComingAndGoing {
    /// How often it was asked.
    pub changes: Cell<usize>,
}

impl Observer for ComingAndGoing {
    fn frame(&mut self, _: &Forming, _: f64) -> Result<(), StepError> {
        Ok(())
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
    fn threads(&self) -> Option<usize> {
        self.changes.set(self.changes.get() + 1);
        Some(1 + self.changes.get() % 3)
    }
}

/// Builds and runs a scene to its end.
pub fn form(p: &Parameters, threads: usize) -> (Forming, Outcome) {
    form_before(&mut Silent, p, threads)
}

/// The same, with somebody who follows it.
pub fn form_before(
    observer: &mut (dyn Observer + Send),
    p: &Parameters,
    threads: usize,
) -> (Forming, Outcome) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let mut forming = build_global(p, &BuiltIn).unwrap();
        let outcome = forming
            .run(&p.control(), observer)
            .unwrap_or_else(|e| panic!("{e:?}"));
        (forming, outcome)
    })
}

/// What is told of a scene whose run does not get to its end.
pub fn stopped(p: &Parameters, threads: usize) -> String {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| {
        let mut forming = build_global(p, &BuiltIn).unwrap();
        match forming.run(&p.control(), &mut Silent) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("it got to its end"),
        }
    })
}

/// For each point of `a` the one of `b` that began at the same place.
pub fn twins(a: &[Vec3], b: &[Vec3]) -> Vec<usize> {
    let near = |p: &Vec3| {
        let by = |i: &usize, j: &usize| norm(sub(b[*i], *p)).total_cmp(&norm(sub(b[*j], *p)));
        let best = (0..b.len()).min_by(by).unwrap();
        assert!(norm(sub(b[best], *p)) < 1e-9, "{p:?}");
        best
    };
    a.iter().map(near).collect()
}

/// Largest distance (m) of the points of two runs.
pub fn apart(whole: &Forming, part: &Forming) -> f64 {
    let mut worst = 0.0f64;
    for (a, b) in whole.bodies.iter().zip(&part.bodies) {
        assert_eq!(a.cells.len(), b.cells.len());
        let twin = twins(&part.reference_points(b), &whole.reference_points(a));
        let (x, y) = (whole.points(a), part.points(b));
        assert_eq!(x.len(), y.len());
        let far = twin.iter().zip(&y).map(|(t, p)| norm(sub(x[*t], *p)));
        worst = far.fold(worst, f64::max);
    }
    worst
}
