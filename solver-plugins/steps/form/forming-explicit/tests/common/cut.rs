//! What a run of the whole leaves of its plies' motion, and zones that are cut out of it.

use plyflow_forming_explicit::{Forming, LocalSheet, Observer, Start};
use plyflow_geometry::vec3::{Vec3, scale, sub};
use plyflow_mechanics::energy::Ledger;
use plyflow_mechanics::history::spline_slopes;
use plyflow_sdk::StepError;

/// Keeps where the plies are at the frames.
#[derive(Default)]
pub struct Film {
    /// Whether the first frame ends the run.
    pub short: bool,
    pub time: Vec<f64>,
    /// `[frames][bodies][nodes]` (m).
    pub points: Vec<Vec<Vec<Vec3>>>,
    /// How often a late start said that it is on its way, and how often it may.
    pub settled: usize,
    pub settles: Option<usize>,
}

impl Observer for Film {
    fn frame(&mut self, forming: &Forming, time: f64) -> Result<(), StepError> {
        self.time.push(time);
        let bodies = forming.bodies.iter().map(|b| forming.points(b));
        self.points.push(bodies.collect());
        if self.short {
            return Err("seen enough".into());
        }
        Ok(())
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
    fn settling(&mut self, _: &Forming) -> Result<(), StepError> {
        self.settled += 1;
        match self.settles {
            Some(most) if self.settled > most => Err("stopped".into()),
            _ => Ok(()),
        }
    }
}

/// The part of a body whose nodes are `inside` in the flat sheet (m), moved as a run of the whole moved it from the frame `first` on; its nodes
/// there are driven where the body goes on. Gives also its nodes' numbers in the body.
pub fn cut_out(
    forming: &Forming,
    film: &Film,
    body: usize,
    inside: &dyn Fn(Vec3) -> bool,
    first: usize,
) -> (LocalSheet, Vec<u32>) {
    let b = &forming.bodies[body];
    let all = forming.reference_points(b);
    let kept = |n: &u32| inside(all[*n as usize]);
    let (kept, gone): (Vec<[u32; 4]>, Vec<[u32; 4]>) =
        b.cells.iter().partition(|c| c.iter().all(kept));
    let mut nodes: Vec<u32> = kept.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let own = |n: &u32| nodes.binary_search(n).ok().map(|k| k as u32);
    let mut driven: Vec<u32> = gone.iter().flatten().filter_map(own).collect();
    driven.sort_unstable();
    driven.dedup();
    let at = |frame: usize, k: &u32| film.points[frame][body][nodes[*k as usize] as usize];
    let position: Vec<Vec<Vec3>> = (0..film.time.len())
        .map(|f| driven.iter().map(|k| at(f, k)).collect())
        .collect();
    let flat: Vec<f64> = position.iter().flatten().flatten().copied().collect();
    let slopes = spline_slopes(&film.time, &flat, 3 * driven.len());
    let of_frame = |f: usize| {
        slopes[3 * driven.len() * f..][..3 * driven.len()]
            .as_chunks()
            .0
    };
    let velocity = (first..film.time.len())
        .map(|f| of_frame(f).to_vec())
        .collect();
    let every: Vec<u32> = (0..nodes.len() as u32).collect();
    let state = |f: usize| every.iter().map(|k| at(f, k)).collect::<Vec<Vec3>>();
    let start = (first > 0).then(|| {
        let span = film.time[first + 1] - film.time[first - 1];
        let rate = |(a, b): (&Vec3, &Vec3)| scale(sub(*b, *a), 1.0 / span);
        Start {
            path: (1..=first).map(state).collect(),
            velocity: state(first - 1)
                .iter()
                .zip(&state(first + 1))
                .map(rate)
                .collect(),
        }
    });
    let sheet = LocalSheet {
        name: b.name.clone(),
        points: nodes.iter().map(|n| all[*n as usize]).collect(),
        cells: kept.iter().map(|c| c.map(|n| own(&n).unwrap())).collect(),
        position: position[first..].to_vec(),
        velocity,
        driven,
        normal: Vec::new(),
        normal_rate: Vec::new(),
        pull: Vec::new(),
        stiffness: Vec::new(),
        start,
    };
    (sheet, nodes)
}
