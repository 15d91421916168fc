//! Whether the parts of a stamping can do what they are to do: they reach plies, start beside them, and stay apart.

use crate::build::drawn::Drawn;
use crate::error::{FormingError, Result};
use crate::stack::{StackSheet, sheet};
use crate::words::in_mm;
use plyflow_geometry::rectangle::{Rectangle, hull};
use plyflow_geometry::vec3::{Vec3, add, cross, norm, scale, sub};
use plyflow_model::scene::Side;
use plyflow_tooling::ToolMesh;

/// Lengths (m) below which two parts, or a part and a ply, count as in touch.
const TOUCH: f64 = 1e-6;
/// Distance (m) of places on large facets at which parts are held against each other.
const SPACING: f64 = 6e-3;
/// Times between two rows of a table, or of the forming time without any, at which parts are held against each other.
const TIMES: usize = 8;

/// Where plies lie at the start, as seen from above.
pub struct Reach {
    /// By ply: its box, and its thickness (m).
    plies: Vec<(Rectangle, f64)>,
    all: Rectangle,
}

impl Reach {
    /// Of a stack of plies.
    ///
    /// # Errors
    /// When a blank has no shape.
    pub fn new(stack: &[StackSheet]) -> Result<Self> {
        let of = |s: &StackSheet| Ok((sheet::blank(s)?.bounds(), s.thickness));
        let plies: Vec<(Rectangle, f64)> = stack.iter().map(of).collect::<Result<_>>()?;
        let boxes = plies.iter().map(|p| p.0);
        let all = boxes.reduce(hull).unwrap_or([0.0; 4]);
        Ok(Self { plies, all })
    }

    /// Thickness of all plies (m).
    fn stack(&self) -> f64 {
        self.plies.iter().map(|p| p.1).sum()
    }

    /// Thickness (m) of the plies that lie over a place, or will after they have been drawn in.
    fn thickness_at(&self, p: Vec3) -> f64 {
        let over = |b: &Rectangle| b[0] <= p[0] && p[0] <= b[2] && b[1] <= p[1] && p[1] <= b[3];
        self.plies
            .iter()
            .filter(|(b, _)| over(b))
            .map(|p| p.1)
            .sum()
    }

    /// The corner of facets under or over the plies that `further` says is the furthest; none where no facet is.
    fn extreme(
        &self,
        mesh: &ToolMesh,
        shift: Vec3,
        further: impl Fn(f64, f64) -> bool,
    ) -> Option<Vec3> {
        let mut found: Option<Vec3> = None;
        for t in 0..mesh.triangles.len() {
            let corners = mesh.corners(t).map(|p| add(p, shift));
            let bounds = |k: usize| {
                let of = corners.map(|p| p[k]);
                [
                    of.into_iter().fold(f64::INFINITY, f64::min),
                    of.into_iter().fold(f64::NEG_INFINITY, f64::max),
                ]
            };
            let ([x0, x1], [y0, y1]) = (bounds(0), bounds(1));
            if x1 < self.all[0] || x0 > self.all[2] || y1 < self.all[1] || y0 > self.all[3] {
                continue;
            }
            for p in corners {
                if found.is_none_or(|q| further(p[2], q[2])) {
                    found = Some(p);
                }
            }
        }
        found
    }

    /// The highest corner of facets under the plies (m).
    pub fn highest(&self, mesh: &ToolMesh, shift: Vec3) -> Option<Vec3> {
        self.extreme(mesh, shift, |a, b| a > b)
    }

    /// The lowest corner of facets over the plies (m).
    fn lowest(&self, mesh: &ToolMesh, shift: Vec3) -> Option<Vec3> {
        self.extreme(mesh, shift, |a, b| a < b)
    }
}

/// Times (s) at which parts are looked at.
fn times(parts: &[&Drawn], end: f64) -> Vec<f64> {
    let mut rows: Vec<f64> = parts.iter().flat_map(|p| p.times()).collect();
    rows.extend([0.0, end]);
    rows.sort_by(f64::total_cmp);
    rows.dedup();
    let between = |w: &[f64]| {
        let (a, b) = (w[0], w[1]);
        (0..TIMES).map(move |k| a + (b - a) * k as f64 / TIMES as f64)
    };
    let mut all: Vec<f64> = rows.windows(2).flat_map(between).collect();
    all.push(end);
    all
}

/// Whether each part is over or under a ply at some time, starts beside the plies, and does not move away from them alone. `blank`: height of the
/// lower face of the lowest ply (m).
pub fn check_reach(parts: &[Drawn], reach: &Reach, blank: f64, end: f64) -> Result<()> {
    for part in parts {
        let at = |t: f64| match part.side {
            Side::Below => reach.highest(&part.mesh, part.shift(t)),
            Side::Above => reach.lowest(&part.mesh, part.shift(t)),
        };
        let name = part.name.word();
        let times = times(&[part], end);
        if times.iter().all(|t| at(*t).is_none()) {
            let [low, high] = part.mesh.bounds().map(|p| add(p, part.shift(0.0)));
            return Err(FormingError::Scene(format!(
                "process.stamping: the part `{name}` is never {} a ply: it reaches from {} to {}, the plies from ({:.1}, {:.1}) to ({:.1}, {:.1}) mm; \
                 move it, or leave it out",
                match part.side {
                    Side::Below => "under",
                    Side::Above => "over",
                },
                in_mm(low),
                in_mm(high),
                1e3 * reach.all[0],
                1e3 * reach.all[1],
                1e3 * reach.all[2],
                1e3 * reach.all[3]
            )));
        }
        // How far (m) it is from the flat plies.
        let room = |p: Vec3| match part.side {
            Side::Below => blank - p[2],
            Side::Above => p[2] - (blank + reach.stack()),
        };
        let Some(first) = at(0.0) else { continue };
        if room(first) < -TOUCH {
            return Err(FormingError::Scene(format!(
                "process.stamping: at the start the part `{name}` reaches {:.3} mm into the plies, at {}; these lie from z = {:.3} to {:.3} mm. Expected a \
                 part that starts {} them: give it a `way` at `time: 0 s`, or the plies another `blank_height`",
                -1e3 * room(first),
                in_mm(first),
                1e3 * blank,
                1e3 * (blank + reach.stack()),
                part.side.word()
            )));
        }
        let moves = !part.times().is_empty();
        let nearer = |t: &f64| at(*t).is_some_and(|p| room(p) < room(first) - TOUCH);
        if moves && room(first) > reach.stack() + TOUCH && !times.iter().any(nearer) {
            return Err(FormingError::Scene(format!(
                "process.stamping: the part `{name}` starts {:.3} mm off the plies, and its table only takes it further away; expected a `way` that gets \
                 smaller: it counts away from the plies, {} of a part {} them",
                1e3 * room(first),
                match part.side {
                    Side::Below => "down",
                    Side::Above => "up",
                },
                part.side.word()
            )));
        }
    }
    Ok(())
}

/// The parts of a stamping, to be held against each other.
pub struct Apart<'a> {
    /// All of them.
    pub parts: &'a [Drawn],
    /// Where plies are.
    pub reach: &'a Reach,
    /// Until when something moves (s).
    pub end: f64,
}

/// Where two parts are nearest to each other.
struct Nearest {
    /// By how much (m) they are nearer than they may be.
    over: f64,
    distance: f64,
    needed: f64,
    at: Vec3,
    time: f64,
}

/// Whether parts stay apart: those on the same side do not go into each other, those on opposite sides leave the plies room. Where a part that
/// is pressed will be nobody knows, so it is looked at as it starts.
///
/// # Errors
/// Which two meet, where and when, or what room they leave.
pub fn check_apart(all: &Apart<'_>) -> Result<()> {
    for (k, one) in all.parts.iter().enumerate() {
        for other in &all.parts[k + 1..] {
            let Some(worst) = all.nearest(one, other) else {
                continue;
            };
            let [a, b] = [one.name.word(), other.name.word()];
            let (at, ms) = (in_mm(worst.at), 1e3 * worst.time);
            return Err(FormingError::Scene(if worst.distance < -TOUCH {
                format!(
                    "process.stamping: the parts `{a}` and `{b}` meet: at t = {ms:.1} ms they are {:.3} mm in each other at {at}. Expected parts that stay \
                     apart: change the place of one, or its table",
                    -1e3 * worst.distance
                )
            } else {
                format!(
                    "process.stamping: the parts `{a}` and `{b}` leave {:.3} mm at {at} at t = {ms:.1} ms, where the plies between them are {:.3} mm thick. \
                     Expected room for the plies: a larger gap, or a table that ends earlier",
                    1e3 * worst.distance.max(0.0),
                    1e3 * worst.needed
                )
            }));
        }
    }
    Ok(())
}

impl Apart<'_> {
    /// Where two parts are nearer than they may be, at the worst.
    fn nearest(&self, one: &Drawn, other: &Drawn) -> Option<Nearest> {
        let opposite = one.side != other.side;
        let pressed = one.is_pressed() || other.is_pressed();
        let times = match pressed {
            true => vec![0.0],
            false => times(&[one, other], self.end),
        };
        let allowed = one.error.largest + other.error.largest + TOUCH;
        let mut worst: Option<Nearest> = None;
        for (a, b) in [(one, other), (other, one)] {
            let places = places(&a.mesh);
            let is_behind = behind(b);
            for t in &times {
                let (from, to) = (a.shift(*t), b.shift(*t));
                if *t > 0.0 && from == a.shift(0.0) && to == b.shift(0.0) {
                    continue;
                }
                for p in &places {
                    let at = add(*p, from);
                    if is_behind(sub(at, to)) {
                        continue;
                    }
                    let distance = b.field.distance_and_gradient(sub(at, to)).0;
                    let needed = match opposite {
                        true => self.reach.thickness_at(at),
                        false => 0.0,
                    };
                    let over = needed - allowed - distance;
                    if over > worst.as_ref().map_or(0.0, |w| w.over) {
                        worst = Some(Nearest {
                            over,
                            distance,
                            needed,
                            at,
                            time: *t,
                        });
                    }
                }
            }
        }
        worst
    }
}

/// Tells whether a place is behind the back of a part as it is drawn, where the walls of its field go on and the part does not. All points of the
/// part are looked at once, not for each place.
pub fn behind(part: &Drawn) -> impl Fn(Vec3) -> bool {
    let [low, high] = part.mesh.bounds();
    let side = part.side;
    move |p| match side {
        Side::Below => p[2] < low[2],
        Side::Above => p[2] > high[2],
    }
}

/// Corners of facets, and places on those that are large.
pub fn places(mesh: &ToolMesh) -> Vec<Vec3> {
    let mut all = mesh.points.clone();
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        let longest = [sub(b, a), sub(c, b), sub(a, c)].map(norm);
        let longest = longest.into_iter().fold(0.0, f64::max);
        // Slivers of a fan are as long as those, and have no area between their corners.
        let area = 0.5 * norm(cross(sub(b, a), sub(c, a)));
        let count = (longest / SPACING).ceil().min(200.0) as usize;
        if count < 2 || area == 0.0 {
            continue;
        }
        for i in 0..=count {
            for j in 0..=count - i {
                let [u, v] = [i, j].map(|k| k as f64 / count as f64);
                all.push(add(a, add(scale(sub(b, a), u), scale(sub(c, a), v))));
            }
        }
    }
    all
}
