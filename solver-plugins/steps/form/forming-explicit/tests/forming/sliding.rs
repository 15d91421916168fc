//! Plies that slide on each other past each other's edges: nothing goes through anything, told from the sheets' places alone.

use crate::common::BuiltIn;
use crate::common::depth::{Depth, depths};
use crate::common::scenes::{bag, ply};
use plyflow_forming_explicit::{Forming, Observer, Parameters, build_global, inverse_bilinear};
use plyflow_mechanics::contact::shape;
use plyflow_mechanics::energy::Ledger;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::model::{NodalLoad, Pressures};
use plyflow_sdk::StepError;
use serde_json::{Value, json};

/// Keeps the deepest of every pair in the frames.
#[derive(Default)]
struct Deepest(Vec<(f64, Depth)>);

impl Observer for Deepest {
    fn frame(&mut self, forming: &Forming, time: f64) -> Result<(), StepError> {
        self.0
            .extend(depths(forming).into_iter().map(|d| (time, d)));
        Ok(())
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
}

/// Forms the scene to its end: the watch stops a run in which something goes through something else. Besides, plies are in films by less than
/// these are thick on the way, and by a tenth of that at the end, and all sheets lie over the bed. Nodes of a lower ply may be deeper in
/// straight cells of an upper one that cut off the tool's fillets: contact is with the upper one's nodes. Gives how far (m) the
/// nodes at the plies' corners have gone past each other.
fn nothing_goes_through(p: &Parameters) -> f64 {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let (forming, seen) = pool.install(|| {
        let mut forming = build_global(p, &BuiltIn).unwrap();
        let mut seen = Deepest::default();
        forming
            .run(&p.control(), &mut seen)
            .unwrap_or_else(|e| panic!("{e:?}"));
        (forming, seen)
    });
    let end = depths(&forming);
    // Each ply against each of the others.
    let plies = forming.stack.len() - 2;
    assert!(end.len() >= plies * (plies + 1), "{end:?}");
    let of_film = |d: &&Depth| d.thinner < 1e-4;
    let on_the_way = (seen.0.iter().filter(|(_, d)| of_film(&d))).map(|(time, d)| (*time, d, 1.0));
    let at_the_end = (end.iter().filter(of_film)).map(|d| (f64::INFINITY, d, 0.1));
    let too_deep: Vec<String> = on_the_way
        .chain(at_the_end)
        .filter(|(_, d, bound)| d.depth > bound * d.thinner)
        .map(|(time, d, _)| format!("{:.0} % at {time} s: {d:?}\n", 100.0 * d.depth / d.thinner))
        .collect();
    assert!(too_deep.is_empty(), "{}", too_deep.concat());
    let mut past = 0.0f64;
    for (body, sheet) in forming.bodies.iter().zip(&forming.stack) {
        let points = forming.points(body);
        let low = points.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
        assert!(low > 0.4 * sheet.thickness, "{}: {low}", body.name);
    }
    // Bodies of plies that have the same mesh: how far their nodes have come apart.
    for pair in forming.bodies[1..forming.bodies.len() - 1].windows(2) {
        let [a, b] = [0, 1].map(|k: usize| forming.points(&pair[k]));
        if a.len() == b.len() {
            let apart = |(p, q): (&[f64; 3], &[f64; 3])| (p[0] - q[0]).hypot(p[1] - q[1]);
            past = a.iter().zip(&b).map(apart).fold(past, f64::max);
        }
    }
    past
}

/// Plies of the non-crimp fabric: sizes (m) and angles (degrees) of the first fibre family.
fn stack(plies: &[([f64; 2], f64)], change: impl FnOnce(&mut Value)) -> Parameters {
    bag(plies.len(), |p| {
        for (k, (size, angle)) in plies.iter().enumerate() {
            let name = format!("ply_{}", k + 1);
            p["scene"]["sheets"][k + 1] =
                ply(&name, &crate::common::fabric(), *size, angle.to_radians());
        }
        p["element_size"] = json!(0.01);
        p["diaphragm_element_size"] = json!(0.012);
        p["time_step"] = json!(1e-5);
        p["frames"] = json!(16);
        // Slow enough for spans that snap not to hit what they fall on.
        p["scene"]["process"]["double_diaphragm"]["drawing_time"] = json!("0.3 s");
        change(p);
    })
}

/// A ridge 25 mm high, over which plies are drawn down on both sides.
fn hat(p: &mut Value) {
    p["scene"]["tool"] = json!({"flat": {"length": "0.16 m", "width": "0.05 m", "height": "0.025 m",
                                         "fillet": "0.012 m", "facet_size": "0.006 m"}});
}

#[test]
fn equal_plies_at_other_angles_slide_on_each_other_and_go_through_nothing() {
    let size = [0.12, 0.1];
    let past = nothing_goes_through(&stack(&[(size, 0.0), (size, -45.0)], hat));
    // Else it shows nothing: further than they are thick.
    assert!(past > 5e-4, "{past}");
}

#[test]
fn three_equal_plies_over_a_spar_go_through_nothing() {
    let size = [0.11, 0.1];
    let plies = [(size, 0.0), (size, 45.0), (size, 20.0)];
    nothing_goes_through(&stack(&plies, |p| {
        p["scene"]["tool"] = json!({"ramped_spar": {
            "length": "0.2 m", "top_width": "0.05 m", "height": "0.025 m", "draft": "8 deg", "fillet": "0.01 m",
            "recess": "0.03 m", "ramp": "0.02 m", "depth": "0.003 m", "side_depth": "0.002 m", "facet_size": "0.006 m"}});
    }));
}

#[test]
fn an_equal_ply_past_the_edge_of_the_one_below_comes_to_rest_on_the_film() {
    let size = [0.12, 0.08];
    let p = stack(&[(size, 0.0), (size, 0.0)], |p| {
        p["element_size"] = json!(0.006);
    });
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    // Further than a cell goes on past its rim, and no further than the upper film is laid over.
    let slid = 12e-3;
    let nodes = forming.model.sheets()[2].nodes.clone();
    for n in nodes {
        forming.model.x_mut()[n as usize][0] += slid;
    }
    let model = &mut forming.model;
    model.set_step(
        p.time_step
            .min(p.step_safety * model.critical_step().unwrap()),
    );
    while model.time() < 0.08 {
        let bag = 1e5 * smooth_step(model.time(), 0.03, 0.04);
        model.set_pressures(Pressures {
            below: bag,
            above: bag,
        });
        model.step(false).unwrap();
    }
    // The film bears what presses on the part that is past the other ply's edge, over 80 mm of width (the upper film's share of it at the edge varies).
    let contacts = forming.model.sheet_contacts().iter();
    let on_film = contacts
        .filter(|c| c.name == "lower/ply_2")
        .flat_map(|c| &c.items);
    let held: f64 = on_film.map(|i| i.normal_force).sum();
    let pressed = 1e5 * size[1] * slid;
    assert!(
        held > 0.6 * pressed && held < 1.4 * pressed,
        "{held} N, {pressed} N"
    );
    for d in depths(&forming) {
        assert!(d.depth < 0.1 * d.thinner, "{d:?}");
    }
}

#[test]
fn films_whose_nodes_do_not_lie_on_each_other_hold_each_other_from_both_sides() {
    let p = stack(&[([0.12, 0.08], 0.0)], |_| {});
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    let [lower, upper] = [0, 2].map(|sheet| forming.model.sheets()[sheet].nodes.clone());
    // The films have one mesh: by half an element, nodes of the lower one lie in the middle of cells of the upper one.
    for n in upper.iter().filter(|n| !lower.contains(n)) {
        (0..2).for_each(|k| forming.model.x_mut()[*n as usize][k] += 6e-3);
    }
    let model = &mut forming.model;
    model.set_step(
        p.time_step
            .min(p.step_safety * model.critical_step().unwrap()),
    );
    // Beside the ply, and inside of where the films are joined.
    let away = |n: &u32| {
        let x = model.x()[*n as usize];
        (x[0] - 0.076).hypot(x[1])
    };
    let node = *(lower.iter())
        .min_by(|a, b| away(a).total_cmp(&away(b)))
        .unwrap();
    let force = [0.0, 0.0, 30.0];
    model.set_loads(vec![NodalLoad {
        node,
        force,
        moment: [0.0; 3],
    }]);
    while model.time() < 0.1 {
        let bag = 1e5 * smooth_step(model.time(), 0.0, 0.03);
        model.set_load_factor(smooth_step(model.time(), 0.03, 0.03));
        model.set_pressures(Pressures {
            below: bag,
            above: bag,
        });
        model.step(false).unwrap();
    }
    let at = forming.model.x()[node as usize];
    let (from, to) = forming.model.sheets()[2].cell_range;
    let heights = forming.model.cells()[from..to].iter().filter_map(|c| {
        let q = c.map(|n| forming.model.x()[n as usize]);
        let xi = inverse_bilinear(q, at)?;
        let inside = xi.iter().all(|x| x.abs() <= 1.0);
        let height = |w: [f64; 4]| (0..4).map(|k| w[k] * q[k][2]).sum::<f64>();
        inside.then(|| height(shape(xi)) - at[2])
    });
    let over: Vec<f64> = heights.collect();
    // 0.3 mm, less the share that is let in and what straight cells cut off; the films are 0.08 mm thick.
    assert!(over.len() == 1 && over[0] > 1.5e-4, "{over:?}");
}
