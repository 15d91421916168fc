//! Whatever differs between two artifacts is told, with its place and size, and nothing else is.

use plyflow_artifact::{
    Artifact, ArtifactWriter, DType, Difference, FieldInfo, How, On, differences,
};
use serde_json::{Value, json};
use std::path::Path;

/// What an artifact of these tests is made of.
#[derive(Clone)]
struct Made {
    kind: &'static str,
    plugin: &'static str,
    attributes: Value,
    result: (&'static str, f64),
    labels: Vec<String>,
    frames: u64,
    /// Added to the third coordinate of this point in this frame (m).
    moved: (u64, usize, f64),
    /// Of the undeformed first point (m).
    start: f64,
    cells: [u32; 4],
    field: (&'static str, f64),
    forces: Vec<f64>,
    count: i64,
}

fn usual() -> Made {
    Made {
        kind: "forming",
        plugin: "a",
        attributes: json!({"defects": [{"length": 0.1}, {"length": 0.2}], "note": "as it is"}),
        result: ("shear_max", 0.5),
        labels: vec!["A".into()],
        frames: 3,
        moved: (0, 0, 0.0),
        start: 0.0,
        cells: [0, 1, 2, 3],
        field: ("shear_angle", 0.25),
        forces: vec![1.0, -8.0, 4.0, 2.0],
        count: 1 << 60,
    }
}

fn write(path: &Path, made: &Made) {
    let mut w = ArtifactWriter::create(path, made.kind).unwrap();
    let mut points = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
    points[0] = made.start;
    w.define_mesh("ply_1", &points, 4, &made.cells, "").unwrap();
    for frame in 0..made.frames {
        w.begin_frame(frame as f64).unwrap();
        let mut now = points.clone();
        if frame == made.moved.0 {
            now[3 * made.moved.1 + 2] += made.moved.2;
        }
        w.frame_points("ply_1", &now).unwrap();
        w.frame_field(
            "ply_1",
            FieldInfo::new(On::Cells, made.field.0, 1, "rad"),
            &[made.field.1],
        )
        .unwrap();
        w.end_frame().unwrap();
    }
    let bytes: Vec<u8> = made.forces.iter().flat_map(|x| x.to_ne_bytes()).collect();
    let shape = [made.forces.len() as u64 / 2, 2];
    w.array("history/force", DType::F64, &shape, "N", &bytes)
        .unwrap();
    w.array("count", DType::I64, &[1], "1", &made.count.to_ne_bytes())
        .unwrap();
    w.attributes(&made.attributes.to_string()).unwrap();
    w.result(made.result.0, made.result.1, "rad").unwrap();
    w.collection(made.labels.clone()).unwrap();
    w.finish(&json!({"plugin": made.plugin})).unwrap();
}

/// What differs from the usual one after this change.
fn after(change: impl FnOnce(&mut Made)) -> Vec<Difference> {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["a.vtkhdf", "b.vtkhdf"].map(|n| folder.path().join(n));
    let mut other = usual();
    change(&mut other);
    write(&first, &usual());
    write(&second, &other);
    let [first, second] = [&first, &second].map(|p| Artifact::open(p).unwrap());
    differences(&first, &second).unwrap()
}

/// The one difference after a change.
fn only(change: impl FnOnce(&mut Made)) -> (String, How) {
    let mut all = after(change);
    assert_eq!(all.len(), 1, "{all:?}");
    let one = all.remove(0);
    (one.place, one.how)
}

#[test]
fn what_made_an_artifact_is_no_difference() {
    assert_eq!(after(|_| {}), []);
    assert_eq!(after(|m| m.plugin = "b"), []);
}

#[test]
fn a_point_that_moved_is_told_with_its_frame_and_size() {
    let (place, how) = only(|m| m.moved = (2, 3, 0.25));
    assert_eq!(place, "points of ply_1");
    let How::Numbers {
        differ,
        of,
        largest,
        at,
        scale,
        unit,
    } = how
    else {
        panic!("{how:?}");
    };
    assert_eq!((differ, of, largest, scale), (1, 36, 0.25, 1.0));
    assert_eq!((at, unit.as_str()), (vec![2, 3, 2], "m"));
    // Where it lay before it was formed, it is another blank: told once for all frames, which have moved too.
    let all = after(|m| m.start = -0.5);
    let places: Vec<&str> = all.iter().map(|d| d.place.as_str()).collect();
    assert_eq!(places, ["undeformed points of ply_1", "points of ply_1"]);
}

#[test]
fn the_last_bit_of_a_number_counts_also_of_a_large_integer() {
    let (place, how) = only(|m| m.forces[1] = f64::from_bits((-8.0f64).to_bits() + 1));
    assert_eq!(place, "array history/force");
    let How::Numbers {
        differ,
        largest,
        at,
        ..
    } = how
    else {
        panic!("{how:?}");
    };
    assert!(differ == 1 && largest > 0.0 && largest < 1e-14);
    assert_eq!(at, [0, 1]);
    // As doubles these two are the same.
    assert_eq!(only(|m| m.count += 1).0, "array count");
}

#[test]
fn results_attributes_and_descriptions_are_told_by_their_places() {
    let number = |first, second| {
        let unit = "rad".to_owned();
        How::Number {
            first,
            second,
            unit,
        }
    };
    let told = |d: (String, How)| (d.0, d.1);
    assert_eq!(
        told(only(|m| m.result.1 = 0.75)),
        ("result shear_max".into(), number(0.5, 0.75))
    );
    let all = after(|m| m.result.0 = "shear_min");
    assert_eq!(all.len(), 2);
    assert_eq!(all[0].how, How::OnlyInFirst);
    assert_eq!(all[1].how, How::OnlyInSecond);
    let (place, how) = only(|m| m.attributes["defects"][1]["length"] = json!(0.3));
    assert_eq!(place, "attribute defects[1].length");
    let (first, second) = (json!(0.2), json!(0.3));
    assert_eq!(how, How::Other { first, second });
    let (place, _) = only(|m| m.attributes["defects"] = json!([]));
    assert_eq!(place, "length of attribute defects");
    let (place, how) = only(|m| m.attributes["more"] = json!(null));
    assert_eq!((place.as_str(), how), ("attribute more", How::OnlyInSecond));
    assert_eq!(only(|m| m.kind = "zones").0, "kind");
    assert_eq!(only(|m| m.labels.push("B".into())).0, "collection");
    assert_eq!(only(|m| m.cells = [1, 2, 3, 0]).0, "cells of ply_1");
    let (place, _) = only(|m| m.field.1 = 0.5);
    assert_eq!(place, "field shear_angle (cells) of ply_1");
    let places = after(|m| m.field.0 = "slip");
    assert_eq!(places.len(), 2);
    // A frame more: the others are compared all the same.
    assert_eq!(only(|m| m.frames = 4).0, "number of times of frames");
    assert_eq!(after(|m| (m.frames, m.moved) = (4, (1, 0, 0.1))).len(), 2);
    assert_eq!(only(|m| m.forces.truncate(2)).0, "array history/force");
}
