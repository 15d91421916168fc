//! The double-diaphragm process in time: weight, pressures as histories.

use crate::common::{BuiltIn, fabric, form};
use plyflow_forming_explicit::{
    Forming, HistoryRow, LocalInput, LocalSheet, MANY, Observer, Outcome, Parameters, Penetration,
    Start, build_global, build_local,
};
use plyflow_mechanics::energy::Ledger;
use plyflow_mechanics::history::linear;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_model::artifact::Zone;
use plyflow_sdk::StepError;
use serde_json::{Value, json};

/// Free fall (m/s2).
const GRAVITY: f64 = plyflow_model::STANDARD_GRAVITY;
/// Frame and ply (m), areal masses of film and fabric (kg/m2).
const FRAME: [f64; 2] = [0.32, 0.28];
const PLY: [f64; 2] = [0.12, 0.09];
const AREAL: [f64; 2] = [0.08, 0.44];

/// A ply between films over a flat block, in coarse elements; `change` is done to the process, `symmetry` to the scene.
fn parameters(symmetry: &[&str], change: impl Fn(&mut Value)) -> Parameters {
    let film = json!({
        "plyflow_material": 1, "name": "film", "plugin": "material-marlow",
        "thickness": "8e-05 m", "areal_mass": "0.08 kg/m2",
        "with": {"uniaxial": {"amplitude": 6.364e6, "growth": 0.4451, "decay": 7.545}, "limit": 5.0}
    });
    let diaphragm =
        |name: &str| json!({"name": name, "kind": "diaphragm", "material": film.clone()});
    let mut process = json!({
        "frame_length": "0.32 m", "frame_width": "0.28 m", "clearance": "0.02 m",
        "bag_pressure": "100000 Pa", "forming_pressure": "100000 Pa",
        "bagging_time": "0.04 s", "lowering_time": "0.06 s", "drawing_time": "0.06 s",
        "settling_time": "0.01 s", "film_pre_stretch": 0.01, "film_joint_margin": "0.03 m"});
    change(&mut process);
    let with = json!({"hourglass": 1.0, "hourglass_floor": 3000.0, "hourglass_normal": 0.01});
    serde_json::from_value(json!({
        "scene": {
            "plyflow_scene": 1, "name": "block",
            "tool": {"flat": {"length": "0.1 m", "width": "0.06 m", "height": "0.02 m", "fillet": "0.012 m",
                              "facet_size": "0.008 m"}},
            "sheets": [diaphragm("lower"),
                       {"name": "ply", "kind": "ply", "material": fabric(), "length": "0.12 m", "width": "0.09 m",
                        "fibre_1": "-0.7853981633974483 rad", "fibre_2": "0.7853981633974483 rad"},
                       diaphragm("upper")],
            "friction": {"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.35, "diaphragm_diaphragm": 0.3},
            "process": {"double_diaphragm": process},
            "symmetry": symmetry
        },
        "element": {"plugin": "m4", "with": with},
        "diaphragm_element": {"plugin": "m4", "with": with},
        "element_size": 0.015, "diaphragm_growth": 1.25, "time_step": 1.2e-5, "step_safety": 0.8,
        "least_areal_mass": 2.0, "damping": 50.0, "contact_stiffness": 0.3, "slip_stiffness": 0.5,
        "contact_damping": 0.3, "contact_augmentation": 0.003, "frames": 8, "tool_grid": 0.004,
        "kinetic_bound": 0.05, "drift_bound": 0.5
    }))
    .expect("the parameters fit their type")
}

/// Steps to `end` (s); `see` gets the model before and after the loads of each step are set.
fn run(forming: &mut Forming, p: &Parameters, end: f64, mut see: impl FnMut(&mut Forming)) {
    let critical = forming.model.critical_step().unwrap();
    forming
        .model
        .set_step(p.time_step.min(p.step_safety * critical));
    while forming.model.time() < end {
        forming.load_at(forming.model.time());
        see(forming);
        forming.model.step(false).unwrap();
    }
}

/// What hangs in the frame under its weight alone: the frame's force upwards, the work of the weight, the ledger's external work.
fn hung(symmetry: &[&str], weight: &str) -> (Forming, [f64; 3]) {
    let mut p = parameters(symmetry, |process| {
        process["weight"] = json!(weight);
        // As good as none, which a scene may not have.
        process["bag_pressure"] = json!("1e-6 Pa");
        process["forming_pressure"] = json!("1e-6 Pa");
        process["bagging_time"] = json!("0.5 s");
        process["film_pre_stretch"] = json!(0.0);
    });
    // Three times the films' own mass: enough to be seen, and light enough for the films to come to rest.
    (p.least_areal_mass, p.damping) = (0.25, 60.0);
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    let (mut before, mut fall, mut work) = (forming.model.x().to_vec(), 0.0, 0.0);
    let mut add_up = |f: &mut Forming| {
        let heights = f.model.x().iter().zip(&before).zip(f.model.own_masses());
        work += heights
            .map(|((x, y), m)| m * fall * (x[2] - y[2]))
            .sum::<f64>();
        (before, fall) = (f.model.x().to_vec(), f.model.body_acceleration()[2]);
    };
    run(&mut forming, &p, 0.5, &mut add_up);
    add_up(&mut forming);
    let held: f64 = forming.model.reactions().iter().map(|r| r[2]).sum();
    let external = forming.model.energies().external;
    let all = [held, work, external].map(|x| forming.copies() * x);
    (forming, all)
}

#[test]
fn the_frame_bears_the_weight_of_the_bodies_own_masses_and_its_work_is_in_the_ledger() {
    let area = |a: [f64; 2]| a[0] * a[1];
    let expected = GRAVITY * (2.0 * AREAL[0] * area(FRAME) + AREAL[1] * area(PLY));
    for (symmetry, weight, sign) in [
        (&[][..], "tool", 1.0),
        (&["x", "y"], "tool", 1.0),
        (&["x", "y"], "away", -1.0),
    ] {
        let (forming, [held, work, external]) = hung(symmetry, weight);
        let case = format!("{symmetry:?} {weight}");
        let own: f64 = forming.model.own_masses().iter().sum();
        let all: f64 = forming.model.mass().iter().sum();
        assert!(all > 2.0 * own, "{case}: mass is added, {own} {all} kg");
        let ratio = sign * held / expected;
        println!("{case}: {ratio} of the weight, work {work} J, in the ledger {external} J");
        assert!(
            (ratio - 1.0).abs() < 2e-3,
            "{case}: {held} N of {expected} N"
        );
        assert!(
            work > 0.0 && (external / work - 1.0).abs() < 1e-3,
            "{case}: {external} J of {work} J"
        );
    }
}

#[test]
fn without_the_option_nothing_has_weight() {
    let mut forming = build_global(&parameters(&[], |_| {}), &BuiltIn).unwrap();
    forming.load_at(0.05);
    assert_eq!(forming.model.body_acceleration(), [0.0; 3]);
}

/// A zone of 60 mm in the middle of the films, held at its rim, that begins at `begin` (s).
fn zone(p: &Parameters, begin: f64) -> Forming {
    let axis: Vec<f64> = (0..5).map(|k| 0.015 * f64::from(k) - 0.03).collect();
    let mesh = QuadMesh::grid(&axis, &axis);
    let on = mesh.on_boundary();
    let driven: Vec<u32> = (0..on.len() as u32).filter(|n| on[*n as usize]).collect();
    let sheet = |name: &str, z: f64| {
        let points: Vec<_> = mesh.points.iter().map(|q| [q[0], q[1], z]).collect();
        let held: Vec<_> = driven.iter().map(|n| points[*n as usize]).collect();
        LocalSheet {
            name: name.into(),
            cells: mesh.cells.clone(),
            position: vec![held; 2],
            velocity: vec![vec![[0.0; 3]; driven.len()]; 2],
            normal: Vec::new(),
            normal_rate: Vec::new(),
            pull: Vec::new(),
            stiffness: Vec::new(),
            start: Some(Start {
                path: vec![points.clone()],
                velocity: vec![[0.0; 3]; points.len()],
            }),
            driven: driven.clone(),
            points,
        }
    };
    let input = LocalInput {
        time: vec![begin, 0.17],
        sheets: vec![
            sheet("lower", 0.0400),
            sheet("ply", 0.0404),
            sheet("upper", 0.0408),
        ],
        cavity: vec![1e5; 2],
        bag: vec![1e5; 2],
        frame: vec![0.04; 2],
        ways: Vec::new(),
        zone: Zone::new("A", [-0.03, -0.03, 0.03, 0.03]),
        element_size: 0.015,
        slower: 1.0,
    };
    build_local(p, input, &BuiltIn).unwrap()
}

#[test]
fn a_zone_has_the_weight_that_the_whole_has_then_however_late_it_begins() {
    let p = parameters(&[], |process| process["weight"] = json!("tool"));
    // Half the bagging: the weight is all there.
    for (begin, at, share) in [(0.0, 0.01, 0.5), (0.0, 0.02, 1.0), (0.1, 0.1, 1.0)] {
        let mut whole = build_global(&p, &BuiltIn).unwrap();
        let mut part = zone(&p, begin);
        for forming in [&mut whole, &mut part] {
            forming.load_at(at);
            let fall = forming.model.body_acceleration();
            assert!(
                fall[2] + GRAVITY * share < 1e-12 && fall[2] + GRAVITY * share > -1e-12,
                "{at} s: {fall:?}"
            );
        }
    }
}

#[test]
fn a_ply_that_does_not_reach_into_a_zone_holds_nothing_off_the_tool_there() {
    let mut p = parameters(&[], |_| {});
    let mut under = p.scene.sheets[1].clone();
    under.name = "under".into();
    p.scene.sheets.insert(1, under);
    let stack = zone(&p, 0.0).stack;
    let offsets: Vec<f64> = stack.iter().map(|s| s.offset).collect();
    let [film, ply] = [0, 1].map(|k| stack[k].thickness);
    assert_eq!(
        offsets,
        [0.5 * film, film + 0.5 * ply, film + ply + 0.5 * film]
    );
}

/// Penetrations of all pairs at every frame.
#[derive(Default)]
struct Deepest(Vec<(f64, Vec<Penetration>)>);

impl Observer for Deepest {
    fn frame(&mut self, forming: &Forming, time: f64) -> Result<(), StepError> {
        self.0.push((time, forming.penetrations()));
        Ok(())
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
}

/// The run tells the largest penetration and quantile of every pair over its frames, and their times.
fn peaks_are_the_largest_of_the_frames(forming: &Forming, outcome: &Outcome, seen: &Deepest) {
    let end = forming.penetrations();
    assert_eq!((end.len(), seen.0.len()), (outcome.peaks.len(), 41));
    let mut passed = 0;
    for (k, (peak, last)) in outcome.peaks.iter().zip(&end).enumerate() {
        let frames = || seen.0.iter().map(|(_, p)| &p[k]);
        let largest = frames().map(|p| p.largest).fold(0.0, f64::max);
        assert_eq!(peak.largest, largest, "{}", last.pair);
        let many = frames().any(|p| p.nodes >= MANY);
        let counted = frames().filter(|p| !many || p.nodes >= MANY);
        let quantile = counted.map(|p| p.q999).fold(0.0, f64::max);
        assert_eq!((peak.q999, peak.many), (quantile, many), "{}", last.pair);
        if peak.largest > 0.0 {
            let (_, then) = seen
                .0
                .iter()
                .find(|(t, _)| *t == peak.largest_time)
                .expect("a frame");
            assert_eq!(
                (then[k].largest, then[k].place),
                (peak.largest, peak.place),
                "{}",
                last.pair
            );
            let (_, then) = seen
                .0
                .iter()
                .find(|(t, _)| *t == peak.q999_time)
                .expect("a frame");
            assert_eq!(then[k].q999, peak.q999, "{}", last.pair);
        }
        passed += usize::from(peak.q999 > 1.2 * last.q999);
        println!("{}: {peak:?}, at the end {} m", last.pair, last.q999);
    }
    assert!(passed > 0, "no pair was deeper on the way than at the end");
}

/// The history tells the steps that were used, and what bounded them.
fn steps_are_told(p: &Parameters, outcome: &Outcome) {
    let rows = &outcome.history;
    let steps: Vec<f64> = rows.iter().map(|r| r.time_step).collect();
    let least = steps.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(least, outcome.smallest_step);
    for (row, dt) in rows.iter().zip(&steps) {
        let bound = p.time_step.min(p.step_safety * row.critical_step);
        // A whole fraction of the time between frames, of which there are hundreds.
        assert!(*dt <= bound && *dt > 0.98 * bound, "{dt} {bound}");
    }
    // They add up to the process, and their number to the run's.
    let last = &rows[rows.len() - 1];
    let interval = (last.time - last.time_step) / p.frames as f64;
    let of_frame = |k: usize| {
        let inside = |r: &&HistoryRow| (r.time / interval - k as f64 - 0.5).abs() < 0.4;
        let row = rows.iter().find(inside).expect("ten rows a frame");
        interval / row.time_step
    };
    let cycles: f64 = (0..p.frames).map(of_frame).sum();
    let done = outcome.cycles as f64 - 1.0;
    assert!((cycles - done).abs() < 0.5, "{cycles} of {done}");
}

#[test]
fn a_single_pressure_below_that_of_the_bag_is_what_the_cavity_ends_with() {
    let mut p = parameters(&[], |process| {
        process["forming_pressure"] = json!("90000 Pa");
        process["drawing_time"] = json!("0.12 s");
        process["settling_time"] = json!("0.02 s");
    });
    p.frames = 10;
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    let outcome = forming
        .run(&p.control(), &mut Deepest::default())
        .unwrap_or_else(|e| panic!("{e:?}"));
    let end = outcome.history.last().unwrap();
    assert!((end.bag - 1e5).abs() < 1.0, "{} Pa", end.bag);
    assert!((end.cavity - 1e4).abs() < 100.0, "{} Pa", end.cavity);
    assert!(
        outcome.health.peak_drift_ratio < 0.01,
        "{:?}",
        outcome.health
    );
}

#[test]
fn pressures_of_a_run_follow_their_tables_and_its_ledger_closes() {
    let rows = |rows: &[[f64; 2]]| {
        let row = |[share, kpa]: &[f64; 2]| json!({"share": share, "pressure": format!("{} Pa", 1e3 * kpa)});
        json!({"table": rows.iter().map(row).collect::<Vec<_>>()})
    };
    let bag = [[0.0, 0.0], [0.5, 0.0], [0.7, 60.0], [1.0, 100.0]];
    let drawn = [
        [0.0, 0.0],
        [0.25, 10.0],
        [0.6, 60.0],
        [0.8, 60.0],
        [1.0, 90.0],
    ];
    let mut p = parameters(&[], |process| {
        process["weight"] = json!("tool");
        process["bag_pressure"] = rows(&bag);
        process["forming_pressure"] = rows(&drawn);
        process["drawing_time"] = json!("0.12 s");
        process["settling_time"] = json!("0.02 s");
    });
    p.frames = 40;
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    let mut seen = Deepest::default();
    let outcome = forming
        .run(&p.control(), &mut seen)
        .unwrap_or_else(|e| panic!("{e:?}"));
    peaks_are_the_largest_of_the_frames(&forming, &outcome, &seen);
    let column =
        |of: fn(&HistoryRow) -> f64| -> Vec<f64> { outcome.history.iter().map(of).collect() };
    let (time, above, below) = (column(|r| r.time), column(|r| r.bag), column(|r| r.cavity));
    for [share, kpa] in bag {
        let t = 0.04 * share;
        let (a, b) = (linear(&time, &above, t), linear(&time, &below, t));
        assert!((a - 1e3 * kpa).abs() < 500.0, "bag {share}: {a} Pa");
        assert!((a - b).abs() < 1e-9, "the cavity is open: {a} {b} Pa");
    }
    // While the film has room it gives way to less than what is drawn; the plateau finds it on tool and bed.
    for ([share, kpa], bound) in drawn.iter().zip([500.0, 11e3, 21e3, 2e3, 1e3]) {
        let (wanted, b) = (1e5 - 1e3 * kpa, linear(&time, &below, 0.1 + 0.12 * share));
        println!("drawn {share}: {b} Pa of {wanted} Pa");
        assert!(
            (b - wanted).abs() < bound,
            "drawn {share}: {b} Pa of {wanted} Pa"
        );
    }
    steps_are_told(&p, &outcome);
    let end = below[below.len() - 1];
    assert!((end - 1e4).abs() < 100.0, "{end} Pa of 10000 Pa at the end");
    assert!(
        outcome.health.peak_drift_ratio < 0.01,
        "{:?}",
        outcome.health
    );
    let (again, same) = form(&p, 2);
    assert_eq!(outcome.peaks, same.peaks);
    assert!(
        forming.model.x() == again.model.x(),
        "two threads give other positions"
    );
}
