//! A zone with finer elements, and one whose process goes on more slowly: what confirm compares with.

mod common;

use common::{TIMES, coarse, interpolate};
use plyflow_testing::{MemoryArtifact, MemoryInput, run};
use serde_json::json;

/// The values of an array.
fn array<'a>(of: &'a MemoryArtifact, name: &str) -> &'a [f64] {
    &of.arrays[name].1
}

/// Whether two arrays are the same but for a factor.
fn is_scaled(of: &MemoryArtifact, by: &MemoryArtifact, name: &str, factor: f64) {
    let (slow, fast) = (array(of, name), array(by, name));
    assert_eq!(slow.len(), fast.len(), "{name}");
    let largest = fast.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    for (a, b) in slow.iter().zip(fast) {
        assert!((a - factor * b).abs() <= 1e-9 * largest, "{name}: {a} {b}");
    }
}

#[test]
fn a_slower_zone_goes_the_same_way_in_more_time() {
    let late = json!({"element_size": 0.005, "start_time": 0.5});
    let slow = json!({"element_size": 0.005, "start_time": 0.5, "slower": 2.0});
    let fast = interpolate(&coarse(0.0), late, &[1]).unwrap();
    let slow = interpolate(&coarse(0.0), slow, &[1]).unwrap();
    let doubled: Vec<f64> = TIMES[2..].iter().map(|t| 2.0 * t).collect();
    assert_eq!(array(&slow, "time"), doubled);
    // `start_time` is asked for in the time of the coarse run, and told in its own.
    assert_eq!(slow.attributes["start_time"], 0.8);
    assert_eq!(slow.attributes["slower"], 2.0);
    assert_eq!(slow.result("start_time"), 0.8);
    for (name, factor) in [
        ("position", 1.0),
        ("velocity", 0.5),
        ("normal", 1.0),
        ("normal_rate", 0.5),
        ("path", 1.0),
        ("start_velocity", 0.5),
    ] {
        is_scaled(&slow, &fast, &format!("ply_1/{name}"), factor);
    }
    for name in ["cavity_pressure", "bag_pressure"] {
        is_scaled(&slow, &fast, name, 1.0);
    }
    // What is as fast as the coarse run does not speak of it.
    assert!(fast.attributes.get("slower").is_none());
}

#[test]
fn finer_divides_the_size_of_plies_and_films_also_where_a_study_advises_it() {
    let size = |parameters| {
        let out = interpolate(&coarse(0.0), parameters, &[1]).unwrap();
        let told = ["element_size", "film_element_size"].map(|k| out.attributes[k].as_f64());
        let cells = ["ply_1", "film_low"].map(|name| out.body(name).cells.len() / 4);
        (told.map(Option::unwrap), cells)
    };
    let (_, [plies, films]) = size(json!({"element_size": 0.005, "film_element_size": 0.01}));
    let finer = json!({"element_size": 0.005, "film_element_size": 0.01, "finer": 2.0});
    let (told, [fine_plies, fine_films]) = size(finer);
    assert_eq!(told, [0.0025, 0.005]);
    assert_eq!((fine_plies, fine_films), (4 * plies, 4 * films));
    let one = json!({"element_size": 0.005, "finer": 2.0});
    assert_eq!(size(one).0, [0.0025, 0.0025]);

    let study = MemoryArtifact {
        kind: "mesh-study".into(),
        attributes: json!({"target_error": 0.1, "zones": [
            {"name": "B", "box": [0.0, 0.0, 0.1, 0.1], "element_size": 0.01, "finest_error": 0.02}]}),
        ..Default::default()
    };
    let (formed, zones) = (coarse(0.0), common::zones());
    let inputs = [
        MemoryInput::new("formed", &formed),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("meshes", &study),
    ];
    let parameters = json!({"element_size": 0.004, "finer": 2.0});
    let out =
        run::<plyflow_boundary_interpolation::BoundaryInterpolation>(parameters, &inputs, &[1]);
    assert_eq!(out.unwrap().attributes["element_size"], 0.005);
}
