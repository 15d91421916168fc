//! Plies on the tool under one film: what presses on them, what the film does where it is free, and what a zone has of it.

use crate::common::cut::{Film, cut_out};
use crate::common::scenes::{diaphragm, single};
use crate::common::{BuiltIn, Silent, form};
use plyflow_forming_explicit::{
    Forming, HistoryRow, LocalInput, Outcome, Parameters, build_global, build_local, depth_warnings,
};
use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_mechanics::history::linear;
use plyflow_model::artifact::Zone;
use serde_json::{Value, json};

/// What is drawn under the film (Pa).
const PRESSURE: f64 = 1e5;
/// Thickness of a ply (m).
const PLY: f64 = 4e-4;

fn closes(outcome: &Outcome) {
    let health = &outcome.health;
    assert!(health.peak_drift_ratio < 0.01, "{health:?}");
}

/// Contact: at the 99.9 % quantile of every pair no more than a tenth of the thinner body. The watch, which shares nothing with it, has
/// nothing to tell.
fn nothing_is_deep(forming: &Forming, outcome: &Outcome) {
    for p in forming.penetrations() {
        assert!(p.q999 < 0.1 * (p.thinner + p.spare), "{p:?}");
    }
    let told = depth_warnings(&outcome.depths);
    assert!(told.is_empty(), "{told:?}");
}

/// Normal forces (N) of the contact of that name at the nodes that `counts` picks by their places.
fn held(forming: &Forming, name: &str, counts: impl Fn(Vec3) -> bool) -> f64 {
    let m = &forming.model;
    let rigid = m.rigid_contacts().iter().filter(|c| c.name == name);
    let rigid = rigid.flat_map(|c| &c.items);
    let rigid = rigid.map(|i| (i.node, f64::from(i.normal_force)));
    let sheets = m.sheet_contacts().iter().filter(|c| c.name == name);
    let sheets = sheets.flat_map(|c| c.items.iter().filter(|i| i.active));
    let all = rigid.chain(sheets.map(|i| (i.node, i.normal_force)));
    all.filter(|(n, _)| counts(m.x()[*n as usize]))
        .map(|(_, f)| f)
        .sum()
}

/// A ply of 60 x 50 mm on a block that is larger than it; `process`: what its frame is.
fn on_a_flat_block(process: &Value) -> (Forming, Outcome) {
    let p = single(1, |p| {
        let scene = &mut p["scene"];
        scene["tool"] = json!({"flat": {"length": "0.14 m", "width": "0.12 m", "height": "0.02 m",
                                        "fillet": "0.008 m", "facet_size": "0.004 m"}});
        scene["sheets"][0]["length"] = json!("0.06 m");
        scene["sheets"][0]["width"] = json!("0.05 m");
        let of = &mut scene["process"]["single_diaphragm"];
        (of["lowering_time"], of["drawing_time"]) = (json!("0.06 s"), json!("0.08 s"));
        for (key, value) in process.as_object().expect("a mapping") {
            of[key] = value.clone();
        }
        p["element_size"] = json!(0.005);
        p["tool_grid"] = json!(0.0025);
        p["frames"] = json!(1);
    });
    form(&p, 1)
}

#[test]
fn a_flat_ply_stays_flat_and_is_pressed_with_the_pressure_times_its_area_with_and_without_a_bed() {
    let with_bed = json!({"frame_length": "0.28 m", "frame_width": "0.26 m"});
    // The frame ends on the tool's own face.
    let without = json!({"frame_length": "0.115 m", "frame_width": "0.095 m", "bed": false, "frame_height": "20 mm"});
    for (process, bed) in [(with_bed, true), (without, false)] {
        let (forming, outcome) = on_a_flat_block(&process);
        println!("bed: {bed}, {:?}", outcome.health);
        closes(&outcome);
        nothing_is_deep(&forming, &outcome);
        assert_eq!(outcome.history.last().unwrap().cavity, 0.0, "bed: {bed}");
        for x in forming.points(&forming.bodies[0]) {
            let off = x[2] - 0.02 - 0.5 * PLY;
            assert!(off.abs() < 1e-5, "bed: {bed}, {off} m at {x:?}");
        }
        // 9 x 7 nodes, 5 mm apart.
        let inside = |x: Vec3| x[0].abs() < 0.0225 && x[1].abs() < 0.0175;
        let expected = 0.045 * 0.035 * PRESSURE;
        for name in ["tool/ply_1", "upper/ply_1"] {
            let force = held(&forming, name, inside);
            println!("bed: {bed}, {name}: {force} N of {expected} N");
            assert!(
                (force / expected - 1.0).abs() < 0.01,
                "bed: {bed}, {name}: {force} N of {expected} N"
            );
        }
        let contacts = forming.model.rigid_contacts();
        let names: Vec<&str> = contacts.iter().map(|c| c.name.as_str()).collect();
        for of_bed in ["bed/ply_1", "bed/upper"] {
            assert_eq!(names.contains(&of_bed), bed, "{names:?}");
        }
    }
}

/// Centre and radius (m) of the circle with the least squares through points of a plane: that of Kasa.
fn circle(points: &[[f64; 2]]) -> ([f64; 2], f64) {
    let count = points.len() as f64;
    let middle = [0, 1].map(|d| points.iter().map(|p| p[d]).sum::<f64>() / count);
    let [mut uu, mut uv, mut vv, mut u3, mut v3] = [0.0; 5];
    for p in points {
        let [u, v] = [p[0] - middle[0], p[1] - middle[1]];
        let square = u * u + v * v;
        (uu, uv, vv) = (uu + u * u, uv + u * v, vv + v * v);
        (u3, v3) = (u3 + 0.5 * u * square, v3 + 0.5 * v * square);
    }
    let whole = uu * vv - uv * uv;
    let [a, b] = [(u3 * vv - v3 * uv) / whole, (v3 * uu - u3 * uv) / whole];
    let radius = (a * a + b * b + (uu + vv) / count).sqrt();
    ([middle[0] + a, middle[1] + b], radius)
}

#[test]
fn a_film_that_hangs_between_tool_and_frame_is_an_arc_of_its_tension_over_the_pressure() {
    // A film as thick as reusable ones, and a tenth as stiff as the bagging film.
    let drawn = 4e3;
    let p = single(1, |p| {
        let scene = &mut p["scene"];
        scene["tool"] = json!({"flat": {"length": "0.2 m", "width": "0.06 m", "height": "0.02 m",
                                        "fillet": "0.006 m", "facet_size": "0.004 m"}});
        let sheets = &mut scene["sheets"];
        (sheets[0]["length"], sheets[0]["width"]) = (json!("0.06 m"), json!("0.03 m"));
        sheets[1] = diaphragm("upper");
        let film = &mut sheets[1]["material"];
        (film["thickness"], film["areal_mass"]) = (json!("1e-3 m"), json!("1.1 kg/m2"));
        film["with"]["uniaxial"]["amplitude"] = json!(6.364e5);
        scene["symmetry"] = json!(["x", "y"]);
        let of = &mut scene["process"]["single_diaphragm"];
        (of["frame_length"], of["frame_width"]) = (json!("0.3 m"), json!("0.16 m"));
        // All air is drawn, so that no pump has to follow the film.
        (of["bed"], of["forming_pressure"]) = (json!(false), json!(format!("{drawn} Pa")));
        of["surroundings"] = of["forming_pressure"].clone();
        (of["lowering_time"], of["drawing_time"]) = (json!("0.08 s"), json!("0.1 s"));
        (of["settling_time"], of["film_pre_stretch"]) = (json!("0.08 s"), json!(0.05));
        p["element_size"] = json!(0.005);
        p["tool_grid"] = json!(0.0025);
        p["frames"] = json!(1);
    });
    let (forming, outcome) = form(&p, 1);
    closes(&outcome);
    assert_eq!(outcome.history.last().unwrap().cavity, 0.0);
    let m = &forming.model;
    // What the frame pulls with at a node beside the middle plane x = 0, over the width that it holds.
    let driven = (0..m.x().len() as u32).filter(|n| m.is_driven(*n));
    let side: Vec<(Vec3, Vec3)> = driven
        .zip(m.reactions())
        .map(|(n, force)| (m.x()[n as usize], *force))
        .filter(|(x, _)| x[1] > 0.083 && x[0] < 0.012)
        .collect();
    let [(first, _), (second, force), (third, _)] = side[..] else {
        panic!("{side:?}");
    };
    assert_eq!(first[0], 0.0);
    let tension = force[1].hypot(force[2]) / (0.5 * (third[0] - first[0]));
    assert!(force[0].abs() < 0.02 * force[1].abs(), "{force:?}");
    // The column of the film's nodes there, where it touches nothing.
    let film = forming.bodies[1].sheet.nodes(m).iter();
    let places = film.map(|n| m.x()[*n as usize]);
    let span: Vec<[f64; 2]> = places
        .filter(|x| (x[0] - second[0]).abs() < 1e-3 && x[1] > 0.036)
        .map(|x| [x[1], x[2]])
        .collect();
    assert!(span.len() > 7, "{span:?}");
    let (centre, radius) = circle(&span);
    println!(
        "tension {tension} N/m, radius {radius} m, T / p {} m",
        tension / drawn
    );
    // It is no straight line.
    let [a, b] = [span[0], span[span.len() - 1]];
    let long = (b[0] - a[0]).hypot(b[1] - a[1]);
    let off_chord =
        |p: &[f64; 2]| ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / long;
    let sag = span.iter().map(off_chord).fold(0.0, f64::min);
    assert!(sag < -1e-3, "{sag} m");
    for p in &span {
        let off = (p[0] - centre[0]).hypot(p[1] - centre[1]) - radius;
        assert!(off.abs() < 1e-4, "{off} m off the arc at {p:?}");
    }
    let ratio = radius * drawn / tension;
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

#[test]
fn plies_that_reach_out_over_a_block_are_laid_onto_it_and_the_bed_with_a_closed_ledger() {
    let p = single(2, |p| {
        p["scene"]["symmetry"] = json!(["x", "y"]);
        p["scene"]["process"]["single_diaphragm"]["weight"] = json!("tool");
        p["frames"] = json!(1);
    });
    // Flat plies begin outside of the tool, off whose edges nodes of long elements stand: in there they would be thrown off.
    let mut begun = build_global(&p, &BuiltIn).unwrap();
    begun.load_at(0.0);
    begun.model.step(false).unwrap();
    for p in begun.penetrations() {
        assert!(p.largest < 1e-8, "{p:?}");
    }
    let (forming, outcome) = form(&p, 1);
    println!("{:?}", outcome.health);
    closes(&outcome);
    nothing_is_deep(&forming, &outcome);
    for (body, sheet) in forming.bodies.iter().zip(&forming.stack) {
        let points = forming.points(body);
        // Over the middle of the block each lies at its place in the stack. The film's checkerboard mode stands in it (decision 9).
        let near = points.iter().filter(|p| p[0].abs().max(p[1].abs()) < 0.016);
        let heights: Vec<f64> = near.map(|p| p[2]).collect();
        let mean = heights.iter().sum::<f64>() / heights.len() as f64;
        let bound = if sheet.is_ply() { 5e-5 } else { 1e-4 };
        assert!(
            (mean - 0.02 - sheet.offset).abs() < bound,
            "{}: {mean}",
            body.name
        );
        // None is in the bed, and none has stayed above.
        let low = 0.5 * sheet.thickness - 1e-5;
        assert!(
            points.iter().all(|p| p[2] > low && p[2] < 0.022),
            "{}",
            body.name
        );
    }
    // Far from the plies the film lies on the bed.
    let film = forming.points(&forming.bodies[2]);
    let far = film
        .iter()
        .filter(|p| p[0].abs() > 0.12 || p[1].abs() > 0.1);
    assert!(far.clone().count() > 50);
    for x in far {
        assert!(x[2] < 0.5 * 8e-5 + 2e-5, "{x:?}");
    }
    let (again, _) = form(&p, 2);
    assert!(
        forming.model.x() == again.model.x(),
        "two threads give other positions"
    );
}

/// A zone of a run of the whole, as `boundary-interpolation` gives it: films reach further than plies.
fn zone(forming: &Forming, film: &Film, history: &[HistoryRow], p: &Parameters) -> LocalInput {
    let rows = |get: fn(&HistoryRow) -> f64| -> Vec<f64> {
        let (t, v): (Vec<f64>, Vec<f64>) = history.iter().map(|r| (r.time, get(r))).unzip();
        film.time.iter().map(|at| linear(&t, &v, *at)).collect()
    };
    let sheet = |body: usize| cut_out(forming, film, body, &|x| inside(x, body), 0).0;
    LocalInput {
        time: film.time.clone(),
        sheets: (0..forming.bodies.len()).map(sheet).collect(),
        cavity: rows(|r| r.cavity),
        bag: rows(|r| r.bag),
        frame: rows(|r| r.frame),
        ways: Vec::new(),
        zone: Zone::new("A", [0.0, -0.1, 0.1, 0.1]),
        element_size: p.element_size,
        slower: 1.0,
    }
}

/// One end of the ply, and the film around it.
fn inside(x: Vec3, body: usize) -> bool {
    let more = if body == 1 { 0.03 } else { 0.0 };
    x[0] > 0.005 - more && x[0] < 0.07 + more && x[1].abs() < 0.05 + more
}

#[test]
fn a_zone_under_one_film_does_what_the_whole_does_there() {
    let mut p = single(1, |p| p["element_size"] = json!(0.01));
    p.frames = 100;
    let mut film = Film::default();
    let mut whole = build_global(&p, &BuiltIn).unwrap();
    let history = whole.run(&p.control(), &mut film).unwrap().history;
    let input = || zone(&whole, &film, &history, &p);
    let mut part = build_local(&p, input(), &BuiltIn).unwrap();
    let names: Vec<&str> = part
        .model
        .rigid_contacts()
        .iter()
        .map(|c| c.name.as_str())
        .collect();
    assert_eq!(
        names,
        ["tool/ply_1", "tool/upper", "bed/ply_1", "bed/upper"]
    );
    let outcome = part.run(&p.control(), &mut Silent).unwrap();
    closes(&outcome);
    nothing_is_deep(&part, &outcome);
    let (sheet, nodes) = cut_out(&whole, &film, 0, &|x| inside(x, 0), 0);
    assert!(sheet.driven.len() > 5 && sheet.driven.len() < nodes.len() / 2);
    let [own, all] = [&part, &whole].map(|f| f.points(&f.bodies[0]));
    let ways = own
        .iter()
        .zip(&nodes)
        .map(|(x, n)| norm(sub(*x, all[*n as usize])));
    let mean = ways.sum::<f64>() / nodes.len() as f64;
    println!("mean distance {mean} m");
    // Less than the ply is thick, on elements of 10 mm.
    assert!(mean < 3e-4, "{mean} m");

    let refused = |change: &dyn Fn(&mut LocalInput)| {
        let mut input = input();
        change(&mut input);
        build_local(&p, input, &BuiltIn)
            .err()
            .expect("refused")
            .to_string()
    };
    let bare = refused(&|i| i.sheets.truncate(1));
    assert!(
        bare.contains("the diaphragm and at least one ply") && bare.contains("ply_1"),
        "{bare}"
    );
    let silent = refused(&|i| i.cavity.clear());
    assert!(silent.contains("pressure in the cavity"), "{silent}");
}

#[test]
fn a_frame_that_ends_in_the_tool_or_comes_up_is_refused_with_what_would_do() {
    let told = |process: &Value| {
        let p = single(1, |p| {
            let of = &mut p["scene"]["process"]["single_diaphragm"];
            for (key, value) in process.as_object().expect("a mapping") {
                of[key] = value.clone();
            }
            let sheet = &mut p["scene"]["sheets"][0];
            (sheet["length"], sheet["width"]) = (json!("0.03 m"), json!("0.02 m"));
            p["element_size"] = json!(0.004);
        });
        build_global(&p, &BuiltIn).err().map(|e| e.to_string())
    };
    let on_tool = json!({"bed": false, "frame_length": "0.074 m", "frame_width": "0.06 m"});
    let text = told(&on_tool).expect("refused");
    for says in [
        "frame_height: given 0.000 mm",
        "end in the tool",
        "`frame_height: 20.000 mm`",
    ] {
        assert!(text.contains(says), "{text}");
    }
    let with = |height: &str| {
        let mut process = on_tool.clone();
        process["frame_height"] = json!(height);
        told(&process)
    };
    assert_eq!(with("0.02 m"), None);
    let text = with("0.03 m").expect("refused");
    assert!(text.contains("expected a frame that comes down"), "{text}");
    let small = json!({"bed": false, "frame_length": "0.05 m", "frame_width": "0.06 m"});
    let text = told(&small).expect("refused");
    assert!(
        text.contains("process.single_diaphragm: the frame") && !text.contains("joint"),
        "{text}"
    );
    // Around the tool it need not be told.
    let around = json!({"bed": false, "frame_length": "0.16 m", "frame_width": "0.12 m"});
    assert_eq!(told(&around), None);
}
