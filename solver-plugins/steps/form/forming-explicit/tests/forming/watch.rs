//! The watch: what is in what is found, told and stopped, whatever the contacts think of it.

use crate::common::scenes::{bag, ply, press};
use crate::common::{BuiltIn, Silent, fabric, form};
use plyflow_forming_explicit::{
    Forming, PairDepth, Parameters, RigidName, Watch, Watched, build_global, depth_warnings,
};
use serde_json::json;

fn build(p: &Parameters) -> Forming {
    build_global(p, &BuiltIn).unwrap()
}

/// What is seen of a model whose nodes have been put elsewhere since it was looked at first.
fn seen(forming: &mut Forming, put: impl FnOnce(&mut Forming)) -> Vec<PairDepth> {
    seen_at(forming, false, put)
}

/// The same; `last`: at the end of a run, when everything is looked at anew.
fn seen_at(forming: &mut Forming, last: bool, put: impl FnOnce(&mut Forming)) -> Vec<PairDepth> {
    let (mut watch, mut watched) = (Watch::new(forming), Watched::default());
    watch.look(forming, &mut watched, false);
    assert!(
        watched.now.iter().all(|d| d.depth == 0.0),
        "nothing is in anything at the start"
    );
    put(forming);
    watch.look(forming, &mut watched, last);
    watch.depths(&watched)
}

fn of<'a>(depths: &'a [PairDepth], pair: &str) -> &'a PairDepth {
    depths.iter().find(|d| d.pair.name == pair).unwrap()
}

/// The node of a sheet nearest to a place in plan (m).
fn node(forming: &Forming, sheet: usize, [x, y]: [f64; 2]) -> usize {
    let away = |n: &u32| {
        let p = forming.model.x()[*n as usize];
        (p[0] - x).powi(2) + (p[1] - y).powi(2)
    };
    let nodes = forming.model.sheets()[sheet].nodes.iter();
    *nodes.min_by(|a, b| away(a).total_cmp(&away(b))).unwrap() as usize
}

#[test]
fn a_node_that_is_put_into_the_tool_is_told_by_how_far_and_where() {
    let mut forming = build(&bag(1, |_| {}));
    let n = node(&forming, 0, [0.0, 0.0]);
    let depths = seen(&mut forming, |f| {
        f.model.x_mut()[n] = [0.01, 0.005, 0.02 - 1e-4]
    });
    let found = of(&depths, "tool/lower").end;
    // Half of the film besides; the field's error is let be.
    let expected = 1e-4 + 4e-5 - forming.field_error(&RigidName::Tool);
    assert!(
        (found.depth - expected).abs() < 1e-9,
        "{found:?}, not {expected}"
    );
    assert_eq!(
        (found.node as usize, found.place),
        (n, [0.01, 0.005, 0.0199])
    );
}

#[test]
fn a_node_that_is_put_through_the_sheet_below_it_is_told_and_one_beside_it_is_not() {
    let thick = 4e-4;
    let scene = |p: &mut serde_json::Value| {
        for (k, length) in [(1, 0.08), (2, 0.12)] {
            p["scene"]["sheets"][k]["length"] = json!(format!("{length} m"));
        }
    };
    let mut forming = build(&bag(2, scene));
    let n = node(&forming, 2, [0.01, 0.01]);
    let below = forming.model.x()[node(&forming, 1, [0.01, 0.01])][2];
    let depths = seen(&mut forming, |f| f.model.x_mut()[n][2] = below - 1e-4);
    let found = of(&depths, "ply_1/ply_2").end;
    // The sheet that is bent down to the node is let be a part of what its elements cannot follow.
    assert!(
        found.depth > 0.6 * (thick + 1e-4) && found.depth < thick + 1.1e-4,
        "{found:?}"
    );
    // It, or the one under it: both are in the other's cells.
    let there = (found.place[0] - 0.01).abs() < 0.007 && (found.place[1] - 0.01).abs() < 0.007;
    assert!(there, "{found:?}");
    // Beyond the shorter ply's end a place between the two plies' middles is beside it, and above the film.
    let mut forming = build(&bag(2, scene));
    let n = node(&forming, 2, [0.055, 0.01]);
    let depths = seen(&mut forming, |f| f.model.x_mut()[n][2] = below + 5e-5);
    assert_eq!(of(&depths, "ply_1/ply_2").end.depth, 0.0);
    assert_eq!(of(&depths, "lower/ply_2").end.depth, 0.0);
    // And there the film is the next one below.
    let mut forming = build(&bag(2, scene));
    let film = forming.model.x()[0][2];
    let depths = seen(&mut forming, |f| f.model.x_mut()[n][2] = film - 1e-4);
    let found = of(&depths, "lower/ply_2").end;
    assert!(found.depth > 0.6 * (2.4e-4 + 1e-4), "{found:?}");
}

#[test]
fn a_film_in_the_other_one_is_told_and_stops_a_run_near_a_ply_and_far_from_all_of_them_is_in_the_table()
 {
    let pairs = ["lower/upper", "lower_off_plies/upper"];
    for (x, expected) in [(0.022, [true, false]), (0.045, [false, true])] {
        let mut forming = build(&bag(1, |p| {
            p["scene"]["sheets"][1]["length"] = json!("0.04 m");
            // Finer than the films: it is these that say how far they may cross.
            p["element_size"] = json!(0.002);
            p["diaphragm_element_size"] = json!(0.006);
        }));
        let [low, high] = [0, 2].map(|sheet| node(&forming, sheet, [x, 0.01]));
        let below = forming.model.x()[low][2];
        let depths = seen(&mut forming, |f| f.model.x_mut()[high][2] = below - 2e-4);
        let found = pairs.map(|name| depths.iter().find(|d| d.pair.name == name).unwrap());
        assert_eq!(
            found.map(|d| d.end.depth > 1e-4),
            expected,
            "{x}: {found:?}"
        );
        let told = depth_warnings(&depths);
        assert_eq!(
            told.iter().any(|w| w.contains("'upper'")),
            expected[0],
            "{told:?}"
        );
        // It stops a run sooner near a ply.
        assert!(found[0].pair.most < 0.6 * found[1].pair.most && found[1].pair.most.is_finite());
    }
}

/// What is seen of a film that lies on a block of 100 mm as if there were no fin of 2 mm on it, 5 mm high, at x = `from` (mm), with a ply of
/// `length` over the middle.
fn through_a_fin(from: f64, length: &str) -> Vec<PairDepth> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("fin.stl");
    let text = crate::common::scenes::blocks(&[
        ([-50.0, -30.0, 0.0], [50.0, 30.0, 15.0]),
        ([from, -20.0, 0.0], [from + 2.0, 20.0, 20.0]),
    ]);
    std::fs::write(&file, text).unwrap();
    let mut forming = build(&bag(1, |p| {
        p["scene"]["tool"] = json!({"stl": {"file": file.to_str().unwrap(), "unit": "1 mm"}});
        p["scene"]["sheets"][1]["length"] = json!(length);
        p["tool_grid"] = json!(0.001);
    }));
    seen_at(&mut forming, true, |f| {
        let nodes = f.model.sheets()[0].nodes.clone();
        nodes
            .iter()
            .for_each(|n| f.model.x_mut()[*n as usize][2] = 0.015 + 4e-5);
    })
}

#[test]
fn an_edge_of_the_tool_that_goes_through_a_film_between_its_nodes_is_told_where_a_ply_is_near() {
    // The fins stand between two rows of nodes.
    let named = |depths: &[PairDepth], name: &str| {
        depths.iter().find(|d| d.pair.name == name).unwrap().clone()
    };
    let deep = |found: &PairDepth, from: f64| {
        let (depth, x) = (found.end.depth, found.end.place[0]);
        // 5 mm of fin, of which a quarter of an element is let be.
        assert!(depth > 2.5e-3 && depth < 5.1e-3, "{:?}", found.end);
        assert!(
            x > from - 1e-4 && x < from + 2.1e-3,
            "{x} beside a fin at {from}"
        );
    };
    let depths = through_a_fin(2.5, "0.1 m");
    deep(&named(&depths, "tool_edges/lower"), 2.5e-3);
    let told = depth_warnings(&depths);
    assert!(
        told.iter().any(|w| w.contains("through 'lower'")),
        "{told:?}"
    );
    assert_eq!(named(&depths, "tool_edges_off_plies/lower").end.depth, 0.0);
    // Far from the ply it is in the table, and no warning.
    let depths = through_a_fin(42.5, "0.04 m");
    deep(&named(&depths, "tool_edges_off_plies/lower"), 42.5e-3);
    assert_eq!(named(&depths, "tool_edges/lower").end.depth, 0.0);
    let told = depth_warnings(&depths);
    assert!(told.iter().all(|w| !w.contains("edge")), "{told:?}");
}

#[test]
fn a_press_is_watched_on_both_sides_of_its_plies() {
    let mut forming = build(&press(1, &json!({"gap": "0.0004 m"}), |_| {}));
    let n = node(&forming, 0, [0.05, 0.01]);
    let z = forming.model.x()[n][2];
    let depths = seen(&mut forming, |f| f.model.x_mut()[n][2] = z + 1e-4);
    assert!((of(&depths, "die/ply_1").end.depth - 1e-4).abs() < 1e-9);
    assert_eq!(of(&depths, "holder/ply_1").end.depth, 0.0);
    let depths = seen(
        &mut build(&press(1, &json!({"gap": "0.0004 m"}), |_| {})),
        |f| {
            f.model.x_mut()[n][2] = z - 1e-4;
        },
    );
    assert!((of(&depths, "holder/ply_1").end.depth - 1e-4).abs() < 1e-9);
}

#[test]
fn a_ply_without_contact_to_the_film_and_the_bed_stops_the_run_with_pair_place_and_time() {
    // The upper ply reaches past the lower one, and falls there.
    let p = bag(2, |p| {
        let plies = [(0.06, "ply_1"), (0.12, "ply_2")];
        for (k, (length, name)) in plies.into_iter().enumerate() {
            p["scene"]["sheets"][k + 1] = ply(name, &fabric(), [length, 0.08], -0.785);
        }
    });
    let mut forming = build(&p);
    let count = forming.model.sheet_contacts().len();
    forming
        .model
        .sheet_contacts_mut()
        .retain(|c| !c.name.starts_with("lower/ply_2"));
    assert!(forming.model.sheet_contacts().len() < count);
    forming
        .model
        .rigid_contacts_mut()
        .retain(|c| !c.name.ends_with("/ply_2") && !c.name.contains("/ply_2/"));
    let told = format!(
        "{:?}",
        forming.run(&p.control(), &mut Silent).expect_err("stopped")
    );
    for part in [
        "'ply_2' has gone through",
        "mm deep in each other",
        "before forming at",
        "seen at t = ",
    ] {
        assert!(told.contains(part), "'{part}' in: {told}");
    }
}

#[test]
fn a_sound_bag_is_told_as_sound_and_the_same_with_any_number_of_threads() {
    let p = bag(2, |p| p["frames"] = json!(20));
    let (one, two) = (form(&p, 1).1, form(&p, 2).1);
    assert_eq!(one.depths, two.depths);
    for d in one.depths.iter().filter(|d| d.pair.bound.is_finite()) {
        eprintln!(
            "{} {:.1} um, on the way {:.1} um",
            d.pair.name,
            1e6 * d.end.depth,
            1e6 * d.peak.deep.depth
        );
        assert!(d.end.depth <= d.pair.bound, "{d:?}");
    }
    assert!(
        one.depths.iter().any(|d| d.peak.deep.depth > 0.0),
        "nothing was seen"
    );
    let rows = one.history.len();
    assert!(
        one.history
            .iter()
            .all(|r| r.depths.len() == one.depths.len()),
        "{rows}"
    );
}
