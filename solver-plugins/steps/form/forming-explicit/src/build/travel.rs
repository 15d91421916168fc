//! How far a part that is pressed may go where the scene does not say it.

use crate::build::apart::{behind, places};
use crate::build::drawn::Drawn;
use plyflow_geometry::vec3::{Vec3, add, norm, scale, sub};

/// Distance (m) at which two parts are in touch.
const TOUCH: f64 = 1e-6;
/// Steps towards each other after which two parts are as near as they get.
const STEPS: usize = 200;

/// Where a part that is pressed has its stop.
pub struct Stop {
    /// How far (m) beyond the place where it is drawn.
    pub travel: f64,
    /// The part that it meets there; none where no part is on the other side of the plies.
    pub meets: Option<String>,
}

/// Where the part at place `k` stops by itself: where it meets a part on the other side of the plies, which stands where it ends. Nothing else can stop it
/// there once the plies are gone, and as long as they are there they hold it: a stop nearer than that would take its force from them.
/// `end`: of the forming (s).
pub fn stop(parts: &[Drawn], k: usize, end: f64) -> Stop {
    let one = &parts[k];
    let others = parts.iter().filter(|other| other.side != one.side);
    let ways = others.filter_map(|other| Some((closing(one, other, end)?, other.name.word())));
    let nearest = ways.min_by(|a, b| a.0.total_cmp(&b.0));
    Stop {
        travel: nearest.as_ref().map_or(0.0, |n| n.0),
        meets: nearest.map(|n| n.1.to_owned()),
    }
}

/// How far (m) a part may go towards the plies until it meets another one; 0 if it is there already, `None` if it goes past.
fn closing(one: &Drawn, other: &Drawn, end: f64) -> Option<f64> {
    let inwards = scale(one.outwards(), -1.0);
    let there = other.shift(end);
    let [own, its] = [one, other].map(|part| places(&part.mesh));
    let nearest = |way: f64| {
        let here = scale(inwards, way);
        least(&own, sub(here, there), other).min(least(&its, sub(there, here), one))
    };
    // No further than from one end of both to the other.
    let corners = [
        one.mesh.bounds(),
        other.mesh.bounds().map(|p| add(p, there)),
    ];
    let span = |d: usize| {
        let of = corners.iter().flatten().map(|p| p[d]);
        let (low, high) = of.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            (a.min(x), b.max(x))
        });
        high - low
    };
    let furthest = norm([span(0), span(1), span(2)]);
    let mut way = 0.0;
    for _ in 0..STEPS {
        // Both come nearer by no more than the way: to go on by the distance never goes into the other part.
        let distance = nearest(way);
        if distance <= TOUCH {
            return Some(way);
        }
        way += distance;
        if way > furthest {
            return None;
        }
    }
    Some(way)
}

/// The least distance (m) of places, moved by `shift`, from a part where it is drawn.
fn least(places: &[Vec3], shift: Vec3, part: &Drawn) -> f64 {
    let at = places.iter().map(|p| add(*p, shift));
    let is_behind = behind(part);
    let beside = at.filter(|p| !is_behind(*p));
    let distance = |p| part.field.distance_and_gradient(p).0;
    beside.map(distance).fold(f64::INFINITY, f64::min)
}
