//! The quiet bag: films and two plies under 1 bar, flat or draped over a dome, the frame at rest, without mass damping: what moves
//! must not gain energy, and no sheet may get through another.
//!
//! The loads come on with mass damping (a drum of film has nothing of its own that would stop it); then it is switched off and
//! the bag is watched. What stays on is what every run has: the damping of the normal approach (`contact_damping` 0.3) and
//! friction. The bound is a millionth of the pressure's work while the bag is evacuated.
//!
//! The multipliers of contact must be content with a small penetration: when they followed every one, the bag began to move
//! after half a second, and grew by e in some 30 ms (`docs/theory/contact.md`).
//!
//! Nodes that lie under the corners of four cells of a hollow master circled by tenths of a micrometre while only two of the
//! cells pushed them (some 1e-5 of the pressure's work, for ever): in the flat bag those of the films, which have one mesh, and
//! those of plies under nodes of a film.

use crate::common::scenes::{self, ply};
use crate::common::{BuiltIn, fabric};
use plyflow_forming_explicit::{Forming, Parameters, build_global, inverse_bilinear};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::contact::shape;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::model::{Drive, Pressures};
use serde_json::json;

/// Vacuum in the bag (Pa).
const PRESSURE: f64 = 1e5;
/// The frame stretches the films, the air is drawn, and the frame goes down (s).
const PHASES: [f64; 3] = [0.05, 0.05, 0.1];
/// Then the frame is at rest, damped (s).
const REST: f64 = 0.1;
/// Mass damping until the end of that (1/s).
const DAMPING: f64 = 200.0;

/// A bag to be watched.
struct Bag {
    /// How far the frame goes down over the tool (m); 0: the bag stays flat above it.
    way: f64,
    /// Edge of the films' elements (m); that of the plies is 10 mm.
    film: f64,
    /// How long it is watched (s).
    hold: f64,
}

/// What was seen.
#[derive(Debug)]
struct Seen {
    /// Work of the pressure while the air was drawn, the frame at rest (J).
    work: f64,
    /// Largest kinetic energy (J) in each tenth of the time for which it is watched.
    kinetic: [f64; 10],
    /// Least distance of a node from the surface under it over that at which they touch.
    least_distance: f64,
}

fn parameters(bag: &Bag) -> Parameters {
    scenes::bag(2, |p| {
        let scene = &mut p["scene"];
        scene["tool"] = json!({"hemisphere": {"radius": "0.06 m", "facet_size": "0.004 m"}});
        scene["sheets"][2] = ply("ply_2", &fabric(), [0.12, 0.08], 0.0);
        p["element_size"] = json!(0.01);
        p["diaphragm_element_size"] = json!(bag.film);
        p["damping"] = json!(DAMPING);
        p["frames"] = json!(1);
    })
}

/// The frame: it stretches the films, waits for the air to be drawn, and goes down.
struct Frame {
    start: Vec<Vec3>,
    way: f64,
}

impl Drive for Frame {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let stretch = 1.0 + 0.01 * smooth_step(t, 0.0, PHASES[0]);
        let down = self.way * smooth_step(t, PHASES[0] + PHASES[1], PHASES[2]);
        let [x, y, z] = self.start[k];
        [stretch * x, stretch * y, z - down]
    }
}

/// Steps to `end` (s); `see` gets the time and the kinetic energy after every step.
fn run(forming: &mut Forming, p: &Parameters, end: f64, mut see: impl FnMut(f64, f64)) {
    let model = &mut forming.model;
    let mut check = model.time();
    while model.time() < end {
        if model.time() >= check {
            model.set_step(
                p.time_step
                    .min(p.step_safety * model.critical_step().unwrap()),
            );
            check += 0.01;
        }
        let bag = PRESSURE * smooth_step(model.time(), PHASES[0], PHASES[1]);
        // The same air around: nothing is drawn from under the lower film.
        model.set_pressures(Pressures {
            below: bag,
            above: bag,
        });
        model.step(false).unwrap();
        see(model.time(), model.kinetic());
    }
}

/// Least height of a node over the sheet under it (along z, times the cosine of the slope), over the distance at which they touch.
fn least_distance(forming: &Forming) -> f64 {
    let model = &forming.model;
    let mut least = f64::INFINITY;
    for contact in model.sheet_contacts() {
        let master = contact.name.split('/').next().unwrap();
        let sheet = model.sheets().iter().find(|s| s.name == master).unwrap();
        let cells = &model.cells()[sheet.cell_range.0..sheet.cell_range.1];
        for item in &contact.items {
            let p = model.x()[item.node as usize];
            for cell in cells {
                let q = cell.map(|n| model.x()[n as usize]);
                let out = |k: usize| {
                    let (lo, hi) = q
                        .iter()
                        .fold((f64::MAX, f64::MIN), |(l, h), c| (l.min(c[k]), h.max(c[k])));
                    p[k] < lo || p[k] > hi
                };
                if out(0) || out(1) {
                    continue;
                }
                let Some(xi) =
                    inverse_bilinear(q, p).filter(|xi| xi.iter().all(|x| x.abs() <= 1.0))
                else {
                    continue;
                };
                let z: f64 = shape(xi).iter().zip(&q).map(|(w, c)| w * c[2]).sum();
                let area = plyflow_mechanics::mesh::area_vector(q);
                let slope = area[2] / plyflow_geometry::vec3::norm(area);
                least = least.min(contact.side * (p[2] - z) * slope / contact.offset);
            }
        }
    }
    least
}

fn watch(bag: &Bag) -> Seen {
    let p = parameters(bag);
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    let film = &forming.bodies[0];
    let mesh = QuadMesh {
        points: forming.points(film),
        cells: film.cells.clone(),
    };
    let on = mesh.on_boundary();
    let nodes = (0..mesh.points.len()).filter(|n| on[*n]);
    let frame: Vec<u32> = nodes.map(|n| n as u32).collect();
    let start = frame.iter().map(|n| mesh.points[*n as usize]).collect();
    let drive = Frame {
        start,
        way: bag.way,
    };
    forming.model.set_driven(frame, Box::new(drive));
    run(&mut forming, &p, PHASES[0], |_, _| {});
    let before = forming.model.energies().external;
    run(&mut forming, &p, PHASES[0] + PHASES[1], |_, _| {});
    let work = (forming.model.energies().external - before).abs();
    let lowering = if bag.way > 0.0 { PHASES[2] } else { 0.0 };
    let begin = PHASES[0] + PHASES[1] + lowering + REST;
    run(&mut forming, &p, begin, |_, _| {});
    forming.model.set_damping(0.0);
    let mut kinetic = [0.0f64; 10];
    run(&mut forming, &p, begin + bag.hold, |t, k| {
        let tenth = ((t - begin) / bag.hold * 10.0) as usize;
        let of = &mut kinetic[tenth.min(9)];
        *of = of.max(k);
    });
    Seen {
        work,
        kinetic,
        least_distance: least_distance(&forming),
    }
}

/// The bag stays quiet: at most `bound` of the pressure's work moves, no more at the end than at the start, and every sheet is
/// where it belongs.
fn assert_quiet(what: &str, bag: &Bag, bound: f64) {
    let seen = watch(bag);
    println!("{what}, {} s: {seen:?}", bag.hold);
    let share = seen.kinetic.map(|k| k / seen.work);
    let most = share.iter().fold(0.0, |m: f64, k| m.max(*k));
    assert!(
        most < bound,
        "{what}: kinetic energy over the pressure's work ({} J), by tenths of {} s: {share:?}; bound {bound}",
        seen.work,
        bag.hold
    );
    // Below a hundredth of the bound it is noise that neither grows nor dies.
    assert!(
        share[9] < 1.2 * share[0].max(0.01 * bound),
        "{what}: kinetic energy grows: {share:?}"
    );
    assert!(
        seen.least_distance > 0.9,
        "{what}: a node has come to {} of its distance from another sheet",
        seen.least_distance
    );
}

/// Largest kinetic energy over the pressure's work.
const BOUND: f64 = 1e-6;

fn flat(hold: f64) -> Bag {
    Bag {
        way: 0.0,
        film: 0.0113,
        hold,
    }
}

fn draped(film: f64, hold: f64) -> Bag {
    Bag {
        way: 0.025,
        film,
        hold,
    }
}

#[test]
fn a_flat_bag_stays_quiet() {
    assert_quiet("flat", &flat(0.05), BOUND);
}

#[test]
fn a_bag_draped_over_a_dome_stays_quiet() {
    assert_quiet("draped", &draped(0.0113, 0.05), BOUND);
}

#[test]
#[ignore = "minutes: make long"]
fn a_flat_bag_stays_quiet_for_a_second() {
    assert_quiet("flat", &flat(1.0), BOUND);
}

#[test]
#[ignore = "minutes: make long"]
fn a_draped_bag_stays_quiet_for_a_second() {
    assert_quiet("draped", &draped(0.0113, 1.0), BOUND);
}

#[test]
fn a_draped_bag_stays_quiet_whose_plies_have_their_nodes_under_those_of_the_films() {
    assert_quiet("node on node", &draped(0.01, 0.05), BOUND);
}

/// Which meshes rest on each other decides how nodes lie in cells, and a contact that is nearly right fails in some of them alone
/// (`docs/decisions/0020`). In the coarser ones some 1e-7 of the work goes on swinging
/// (6.7e-8 becomes 8.4e-8 with films of 11.5 mm): here the bound alone is asked for, not that it grows by less than a fifth.
#[test]
#[ignore = "minutes: make long"]
fn draped_bags_stay_quiet_whatever_the_mesh_of_the_films() {
    for k in 0..16 {
        let film = 0.010 + 0.00025 * f64::from(k);
        let seen = watch(&draped(film, 0.05));
        let share = seen.kinetic.map(|k| k / seen.work);
        let what = format!("films of {:.2} mm", 1e3 * film);
        println!("{what}: {share:?}, {}", seen.least_distance);
        assert!(share.iter().all(|s| *s < BOUND), "{what}: {share:?}");
        assert!(seen.least_distance > 0.9, "{what}: {}", seen.least_distance);
    }
}
