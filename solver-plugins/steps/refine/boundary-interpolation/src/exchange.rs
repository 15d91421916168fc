//! Experiments on what a cut lacks: single things that another run of the same whole gives in place of the coarse run.

use crate::coarse::{Coarse, Motion, Whole};
use crate::grid::{Grid, SIDES};
use plyflow_geometry::vec3::{Vec3, add, cross, dot, scale, sub, unit};
use plyflow_model::artifact::Forming;
use plyflow_sdk::{Host, Input, Meshes, StepError};
use serde::Deserialize;

/// What may be taken from the other run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Where all nodes are when the fine run begins late, and how fast.
    Start,
    /// The motion of the diaphragms' cuts.
    Films,
    /// The plies' motion in their surface, at right angles to the cut.
    Across,
    /// The plies' motion in their surface, in the direction of the cut.
    Along,
    /// The plies' motion off their surface.
    Height,
    /// The directions of the plies' normals, for nodes that rotate.
    Normals,
    /// What pulls at cuts that give way.
    Forces,
    /// Pressures and the height of the frame.
    Loads,
}

/// Share of the frames in which one run's motion is led over to the other's, where these do not begin at one place.
const LEADING: f64 = 0.05;

/// Frames of both runs may be this share of their distance apart in time.
const SAME_TIME: f64 = 0.05;

/// The other run, and what is taken from it.
pub(crate) struct Exchange {
    pub(crate) input: Input,
    pub(crate) meshes: Meshes,
    run: Forming,
    parts: Vec<Part>,
}

impl Exchange {
    /// Of the input `other`, whose frames must be those of the coarse run (at `times`, s). `None` when nothing is exchanged.
    ///
    /// # Errors
    /// When there are parts without a run or a run without parts, or when its frames are others.
    pub(crate) fn read(
        host: &Host,
        parts: &[Part],
        times: &[f64],
    ) -> Result<Option<Self>, StepError> {
        let input = match (host.inputs_of("other")?.pop(), parts.is_empty()) {
            (None, true) => return Ok(None),
            (Some(input), false) => input,
            (Some(input), true) => {
                let step = &input.step;
                return Err(format!("'{step}' is given as `other`, and `exchanged` is empty: say what it gives in place of `formed`, or leave it out").into());
            }
            (None, false) => {
                return Err("`exchanged` is given without a run that gives it: name it as `other`, or leave `exchanged` out".into());
            }
        };
        let (run, meshes): (Forming, _) = (host.attributes(&input)?, host.meshes(&input)?);
        check_times(&input.step, &meshes.times, times)?;
        Ok(Some(Self {
            input,
            meshes,
            run,
            parts: parts.to_vec(),
        }))
    }

    pub(crate) fn has(&self, part: Part) -> bool {
        self.parts.contains(&part)
    }

    /// The sheet of this name with a fine mesh placed in it.
    pub(crate) fn placed(
        &self,
        host: &Host,
        name: &str,
        grid: Grid,
    ) -> Result<Coarse<'_>, StepError> {
        let found = self.run.sheets.iter().find(|s| s.name == name);
        let sheet = found.ok_or_else(|| {
            let step = &self.input.step;
            format!("'{step}' has no sheet '{name}': `other` must be a run of the same scene as `formed`")
        })?;
        Whole::read(host, &self.input, &self.meshes, sheet)?.placed(grid)
    }

    /// Share of the other run's motion at a frame, for a fine run that begins at the frame `first` of `frames`: all or nothing of it, and on
    /// the way there in the first frames where the fine run begins with the other of both.
    fn share(&self, taken: bool, frame: usize, first: usize, frames: usize) -> f64 {
        if first == 0 || taken == self.has(Part::Start) {
            return f64::from(u8::from(taken));
        }
        let way = frame.saturating_sub(first) as f64 / (LEADING * (frames - 1) as f64);
        let s = way.min(1.0);
        let led = s * s * (3.0 - 2.0 * s);
        if taken { led } else { 1.0 - led }
    }

    /// Puts the other run's motion of a sheet's driven nodes in place of the coarse run's `motion`, as far as it is taken.
    pub(crate) fn mix(&self, motion: &mut Motion, other: &Motion, of: &Coarse<'_>, first: usize) {
        let nodes = of.fine.driven_nodes.len();
        let frames = motion.position.len() / (3 * nodes.max(1));
        let ply = of.is_ply();
        let beside = neighbours(&of.fine.grid, &of.fine.driven_nodes);
        for f in 0..frames {
            let share = |part| self.share(self.has(part), f, first, frames);
            let range = 3 * nodes * f..3 * nodes * (f + 1);
            let theirs = &other.position.as_chunks::<3>().0[nodes * f..nodes * (f + 1)];
            let ours = motion.position[range.clone()].as_chunks::<3>().0.to_vec();
            let normals = (motion.normal.as_ref()).map(|n| n[range.clone()].as_chunks::<3>().0);
            let mixed = ours.iter().zip(theirs).enumerate();
            let mixed = mixed.flat_map(|(k, (&p, &q))| {
                let way = sub(q, p);
                let Some(normals) = normals.filter(|_| ply) else {
                    return add(p, scale(way, share(Part::Films)));
                };
                let [a, b] = beside[k];
                let [across, along, height] = axes(sub(ours[b], ours[a]), normals[k]);
                let of = |axis: Vec3, part| scale(axis, share(part) * dot(way, axis));
                let in_surface = add(of(across, Part::Across), of(along, Part::Along));
                add(p, add(in_surface, of(height, Part::Height)))
            });
            let mixed: Vec<f64> = mixed.collect();
            if let (Some(own), Some(theirs)) = (&mut motion.normal, &other.normal) {
                let s = share(Part::Normals);
                for (n, m) in own[range.clone()]
                    .as_chunks_mut::<3>()
                    .0
                    .iter_mut()
                    .zip(theirs[range.clone()].as_chunks::<3>().0)
                {
                    *n = unit(add(scale(*n, 1.0 - s), scale(*m, s)));
                }
            }
            motion.position[range].copy_from_slice(&mixed);
        }
    }
}

/// Unit vectors across the cut and along it in the ply's surface, and off the surface; `along` is a way along the cut.
fn axes(along: Vec3, normal: Vec3) -> [Vec3; 3] {
    let along = unit(sub(along, scale(normal, dot(along, normal))));
    [cross(along, normal), along, normal]
}

/// By driven node, the driven nodes before and after it on its side (itself at an end), as positions among them.
fn neighbours(grid: &Grid, driven: &[u32]) -> Vec<[usize; 2]> {
    let mut beside: Vec<Option<[usize; 2]>> = vec![None; driven.len()];
    for nodes in (0..SIDES).filter_map(|side| grid.cuts[side].as_ref()) {
        let place = |i: usize| driven.partition_point(|d| *d < nodes[i]);
        for i in 0..nodes.len() {
            let both = [i.saturating_sub(1), (i + 1).min(nodes.len() - 1)].map(place);
            beside[place(i)].get_or_insert(both);
        }
    }
    // Of a cut that follows cells of an outlined ply.
    let place = |n: u32| driven.partition_point(|d| *d < n);
    for [from, to] in grid.pieces.iter().map(|p| p.map(place)) {
        beside[from].get_or_insert([from; 2])[1] = to;
        beside[to].get_or_insert([to; 2])[0] = from;
    }
    beside
        .into_iter()
        .map(|b| b.expect("a driven node lies on a cut side"))
        .collect()
}

/// That both runs have their frames at the same times.
fn check_times(step: &str, theirs: &[f64], ours: &[f64]) -> Result<(), String> {
    let apart = |(a, b): (&f64, &f64)| (a - b).abs();
    let furthest = theirs.iter().zip(ours).map(apart).fold(0.0, f64::max);
    let interval = (ours[ours.len() - 1] - ours[0]) / (ours.len() - 1) as f64;
    if theirs.len() != ours.len() || furthest > SAME_TIME * interval {
        let (n, m) = (theirs.len(), ours.len());
        return Err(format!(
            "other: '{step}' has {n} frames, and `formed` {m}, up to {furthest:.3e} s apart; expected both at the same times. Run both with the same scene and `frames`"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_a_frame_of_the_cut_and_make_up_every_way() {
        let normal = unit([0.2, -0.3, 0.9]);
        let [across, along, height] = axes([0.0, 2.0, 0.1], normal);
        for (a, b) in [(across, along), (across, height), (along, height)] {
            assert!(dot(a, b).abs() < 1e-15);
        }
        assert!(along[1] > 0.9 && across[0].abs() > 0.9);
        let way = [0.3, -0.1, 0.7];
        let sum = [across, along, height]
            .iter()
            .fold([0.0; 3], |s, a| add(s, scale(*a, dot(way, *a))));
        assert!(sub(sum, way).iter().all(|d| d.abs() < 1e-15), "{sum:?}");
    }

    #[test]
    fn runs_with_frames_at_other_times_are_refused() {
        assert_eq!(
            check_times("full", &[0.0, 0.1004, 0.2], &[0.0, 0.1, 0.2]),
            Ok(())
        );
        let refused = check_times("full", &[0.0, 0.11, 0.2], &[0.0, 0.1, 0.2]).unwrap_err();
        assert!(refused.contains("1.000e-2 s apart"), "{refused}");
        assert!(check_times("full", &[0.0, 0.2], &[0.0, 0.1, 0.2]).is_err());
    }
}
