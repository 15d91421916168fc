//! Rules of a scene that a plugin or the workflow alone used to know: whoever reads the scene now refuses the same.

/// What is changed of a scene.
type Change<'a> = &'a dyn Fn(&mut Value);
/// Rows of a table: seconds and kPa, say.
type Rows<'a> = &'a [(f64, f64)];

use plyflow_model::fault::Rule;
use plyflow_model::rules;
use plyflow_model::scene::Scene;
use serde_json::{Value, json};

fn sheet(name: &str, kind: &str) -> Value {
    let material = json!({"plyflow_material": 1, "name": "cloth", "plugin": "material-fabric", "thickness": "0.4 mm", "areal_mass": "0.4 kg/m2"});
    let mut sheet = json!({"name": name, "kind": kind, "material": material});
    if kind == "ply" {
        let ply =
            json!({"length": "200 mm", "width": "100 mm", "fibre_1": "0 deg", "fibre_2": "90 deg"});
        sheet
            .as_object_mut()
            .unwrap()
            .extend(ply.as_object().unwrap().clone());
    }
    sheet
}

fn scene(sheets: &[(&str, &str)], process: Value) -> Value {
    let sheets: Vec<Value> = sheets
        .iter()
        .map(|(name, kind)| sheet(name, kind))
        .collect();
    json!({
        "plyflow_scene": 1, "name": "s", "sheets": sheets,
        "friction": {"tool_fabric": 0.2, "fabric_fabric": 0.3, "tool_diaphragm": 0.4, "fabric_diaphragm": 0.4, "diaphragm_diaphragm": 0.4},
        "tool": {"flat": {"length": "200 mm", "width": "100 mm", "height": "20 mm", "fillet": "5 mm", "facet_size": "5 mm"}},
        "process": process,
    })
}

/// Two films and two plies.
fn bag(change: impl FnOnce(&mut Value)) -> Value {
    let process = json!({"double_diaphragm": {
        "frame_length": "1 m", "frame_width": "1 m", "clearance": "10 mm", "bag_pressure": "1 bar", "forming_pressure": "1 bar",
        "bagging_time": "0.2 s", "lowering_time": "0.3 s", "drawing_time": "0.4 s", "settling_time": "0.1 s", "film_joint_margin": "30 mm"}});
    let stack = [
        ("low", "diaphragm"),
        ("a", "ply"),
        ("b", "ply"),
        ("high", "diaphragm"),
    ];
    let mut scene = scene(&stack, process);
    change(&mut scene);
    scene
}

/// Two plies.
fn press(change: impl FnOnce(&mut Value)) -> Value {
    let process = json!({"press": {"stroke": "20 mm", "forming_time": "100 ms", "settling_time": "10 ms",
        "die": {"opening_radius": "50 mm", "edge_radius": "5 mm"}, "holder": {"hold": {"gap": "1 mm"}}}});
    let mut scene = scene(&[("a", "ply"), ("b", "ply")], process);
    change(&mut scene);
    scene
}

/// Two plies under one film.
fn single(change: impl FnOnce(&mut Value)) -> Value {
    let process = json!({"single_diaphragm": {
        "frame_length": "1 m", "frame_width": "1 m", "clearance": "10 mm", "forming_pressure": "0.9 bar",
        "stretching_time": "0.2 s", "lowering_time": "0.3 s", "drawing_time": "0.4 s", "settling_time": "0.1 s"}});
    let stack = [("a", "ply"), ("b", "ply"), ("high", "diaphragm")];
    let mut scene = scene(&stack, process);
    change(&mut scene["process"]["single_diaphragm"]);
    scene
}

fn refused(scene: Value) -> Result<(), (Rule, String)> {
    let scene = Scene::from_json(scene).unwrap_or_else(|e| panic!("{e}"));
    rules::check(&scene).map_err(|fault| (fault.rule, fault.to_string()))
}

fn assert_refused(scene: Value, rule: Rule, says: &[&str]) {
    let (found, text) = refused(scene).expect_err(says[0]);
    assert_eq!(found, rule, "{text}");
    for part in says {
        assert!(text.contains(part), "'{part}' in: {text}");
    }
}

#[test]
fn sound_scenes_keep_every_rule() {
    assert_eq!(refused(bag(|_| ())), Ok(()));
    assert_eq!(refused(press(|_| ())), Ok(()));
    assert_eq!(refused(single(|_| ())), Ok(()));
}

#[test]
fn under_one_film_no_more_is_drawn_than_there_is_and_its_frame_ends_on_the_bed_or_at_a_height() {
    for (key, value, says) in [
        ("forming_pressure", json!("0 bar"), "nothing is formed"),
        (
            "forming_pressure",
            json!("1.1 bar"),
            "at most `surroundings` (1 bar)",
        ),
        (
            "surroundings",
            json!("0.8 bar"),
            "forming_pressure: given 0.9 bar; expected at most `surroundings` (0.8 bar",
        ),
        ("surroundings", json!("0 bar"), "surroundings: given 0 bar"),
        ("clearance", json!("-1 mm"), "begins above the plies"),
        (
            "frame_height",
            json!("5 mm"),
            "`bed: false` takes the bed away",
        ),
        ("weight", json!("away"), "`tool`, or no `weight`"),
        (
            "frame_width",
            json!("90 mm"),
            "more than the 100 mm that ply `b` takes",
        ),
        (
            "forming_pressure",
            json!({"table": [{"share": 0, "pressure": "0 Pa"}, {"share": 0.8, "pressure": "1 bar"}]}),
            "where drawing ends",
        ),
    ] {
        let (_, text) = refused(single(|p| p[key] = value)).expect_err(says);
        assert!(
            text.contains(says) && text.contains("process.single_diaphragm."),
            "{key}: {text}"
        );
    }
    let hung = |height: &str| {
        single(|p| {
            p["bed"] = json!(false);
            p["frame_height"] = json!(height);
        })
    };
    assert_eq!(refused(hung("5 mm")), Ok(()));
    assert_refused(
        hung("-5 mm"),
        Rule::Frame,
        &["frame_height: given -5 mm", "0 mm or more"],
    );
    // In an autoclave.
    assert_eq!(
        refused(single(|p| p["surroundings"] = json!("7 bar"))),
        Ok(())
    );
}

#[test]
fn only_on_another_ply_a_ply_is_tied() {
    let tied = |k: usize| bag(|s| s["sheets"][k]["tied"] = json!(true));
    assert_eq!(refused(tied(2)), Ok(()));
    assert_refused(
        tied(1),
        Rule::Stack,
        &["sheets[1].tied", "lies on the diaphragm"],
    );
    assert_refused(
        tied(0),
        Rule::Size,
        &["sheets[0].tied", "a diaphragm has no `tied`"],
    );
    // In a press the first ply has nothing below it.
    let lowest = press(|s| s["sheets"][0]["tied"] = json!(true));
    assert_refused(
        lowest,
        Rule::Stack,
        &["sheets[0].tied", "no sheet lies below"],
    );
}

#[test]
fn a_bag_without_pressure_forms_nothing() {
    for name in ["bag_pressure", "forming_pressure"] {
        let none = bag(|s| s["process"]["double_diaphragm"][name] = json!("0 bar"));
        let path = format!("process.double_diaphragm.{name}: given 0 bar");
        assert_refused(none, Rule::Pressure, &[&path, "nothing is formed"]);
    }
}

#[test]
fn a_table_of_pressures_runs_over_its_phase_and_draws_no_more_than_the_bag_has() {
    let table = |rows: &[(f64, f64)]| {
        let row =
            |(share, kpa): &(f64, f64)| json!({"share": share, "pressure": format!("{kpa} kPa")});
        json!({"table": rows.iter().map(row).collect::<Vec<_>>()})
    };
    let with = |name: &str, rows: &[(f64, f64)]| {
        bag(|s| s["process"]["double_diaphragm"][name] = table(rows))
    };
    let sound = [(0.0, 0.0), (0.5, 90.0), (1.0, 100.0)];
    assert_eq!(refused(with("bag_pressure", &sound)), Ok(()));
    let cases: [(&str, Rows, &str, &str); 8] = [
        (
            "bag_pressure",
            &[(0.0, 0.0)],
            "table: the table has one row",
            "two or more",
        ),
        (
            "bag_pressure",
            &[(0.1, 0.0), (1.0, 9.0)],
            "table[0].share: given 0.1",
            "where bagging begins",
        ),
        (
            "bag_pressure",
            &[(0.0, 5.0), (1.0, 9.0)],
            "table[0].pressure: given 0.05 bar",
            "so that nothing jumps",
        ),
        (
            "bag_pressure",
            &[(0.0, 0.0), (0.5, 9.0), (0.5, 9.0), (1.0, 9.0)],
            "table[2].share: given 0.5",
            "more than the 0.5",
        ),
        (
            "bag_pressure",
            &[(0.0, 0.0), (0.9, 9.0)],
            "table[1].share: given 0.9",
            "where bagging ends",
        ),
        (
            "forming_pressure",
            &[(0.0, 0.0), (0.3, -1.0), (1.0, 9.0)],
            "table[1].pressure: given -0.01 bar",
            "0 Pa or more",
        ),
        (
            "forming_pressure",
            &[(0.0, 0.0), (0.5, 120.0), (1.0, 9.0)],
            "table[1].pressure: given 1.2 bar",
            "at most `bag_pressure` (1 bar)",
        ),
        (
            "forming_pressure",
            &[(0.0, 0.0), (0.8, 9.0)],
            "table[1].share: given 0.8",
            "where drawing ends",
        ),
    ];
    for (name, rows, given, expected) in cases {
        let path = format!("process.double_diaphragm.{name}.{given}");
        assert_refused(with(name, rows), Rule::Pressure, &[&path, expected]);
    }
}

#[test]
fn a_gap_of_the_holder_is_as_thick_as_the_plies() {
    let with = |gap: &str| press(|s| s["process"]["press"]["holder"]["hold"]["gap"] = json!(gap));
    assert_eq!(refused(with("0.8 mm")), Ok(()));
    assert_refused(
        with("0.7 mm"),
        Rule::Press,
        &["holder.hold.gap: given 0.7 mm", "0.8 mm thick"],
    );
}

#[test]
fn a_ply_inside_of_the_die_s_opening_is_refused() {
    let with =
        |radius: &str| press(|s| s["process"]["press"]["die"]["opening_radius"] = json!(radius));
    assert_eq!(refused(with("111 mm")), Ok(()));
    assert_refused(
        with("112 mm"),
        Rule::Press,
        &["opening_radius: given 112 mm", "ply `a` reaches"],
    );
}

#[test]
fn families_cross_at_the_least_angle_that_a_net_takes() {
    let with = |angle: &str| press(|s| s["sheets"][1]["fibre_2"] = json!(angle));
    assert_eq!(refused(with("6 deg")), Ok(()));
    assert_refused(
        with("5.9 deg"),
        Rule::Fibres,
        &["sheets[1].fibre_2", "6 deg or more"],
    );
}

#[test]
fn a_ply_says_where_both_families_run_and_each_sheet_has_a_name_of_its_own() {
    let one = bag(|s| drop(s["sheets"][1].as_object_mut().unwrap().remove("fibre_2")));
    assert_refused(
        one,
        Rule::Size,
        &["sheets[1].fibre_2: a ply needs `fibre_2`"],
    );
    let twice = bag(|s| s["sheets"][2]["name"] = json!("a"));
    assert_refused(
        twice,
        Rule::Name,
        &["sheets[2].name: the name `a` is taken"],
    );
}

#[test]
fn names_of_all_rigid_parts_are_taken_whatever_the_process() {
    for name in ["tool", "bed", "die", "holder"] {
        let taken = bag(|s| s["sheets"][1]["name"] = json!(name));
        assert_refused(taken, Rule::Name, &["sheets[1].name", "is taken"]);
    }
}

#[test]
fn sheets_that_are_no_neighbours_rub_past_the_edges_of_the_others() {
    let with = |between: [&str; 2], scene: fn(Change) -> Value| {
        scene(&|s: &mut Value| {
            s["friction"]["pairs"] = json!([{"between": between, "coefficient": 0.3}]);
        })
    };
    assert_eq!(refused(with(["low", "b"], |c| bag(|s| c(s)))), Ok(()));
    assert_eq!(refused(with(["die", "a"], |c| press(|s| c(s)))), Ok(()));
    let apart = with(["tool", "a"], |c| bag(|s| c(s)));
    assert_refused(
        apart,
        Rule::Pairs,
        &["friction.pairs[0].between", "do not rub"],
    );
}

#[test]
fn whose_fibres_a_law_by_angle_means_is_clear_in_every_contact() {
    let law = |of: Value| {
        let factors = json!([{"angle": "0 deg", "factor": 1}, {"angle": "90 deg", "factor": 1.2}]);
        json!({"coefficient": 0.3, "angle": {"of": of, "factors": factors}})
    };
    let with = |class: &str, of: Value| bag(|s| s["friction"][class] = law(of));
    assert_eq!(refused(with("fabric_diaphragm", Value::Null)), Ok(()));
    assert_eq!(refused(with("fabric_fabric", json!("lower"))), Ok(()));
    for (class, of, says) in [
        ("fabric_fabric", Value::Null, "both have fibres"),
        ("fabric_diaphragm", json!("lower"), "no fibres"),
        ("tool_diaphragm", Value::Null, "a law without `angle`"),
    ] {
        let path = format!("friction.{class}.angle.of");
        assert_refused(with(class, of), Rule::Friction, &[&path, says]);
    }
    let region = press(|s| {
        s["sheets"][0]["regions"] = json!([{"name": "r", "rectangle": {"length": "20 mm", "width": "20 mm"}, "friction": {"all": law(Value::Null)}}]);
    });
    assert_refused(
        region,
        Rule::Friction,
        &[
            "sheets[0].regions[0].friction.all.angle",
            "both have fibres",
        ],
    );
}

#[test]
fn a_ply_that_folds_rubs_on_itself_where_plies_have_friction() {
    let factors = json!([{"angle": "0 deg", "factor": 1}, {"angle": "90 deg", "factor": 1.2}]);
    let law = json!({"coefficient": 0.3, "angle": {"factors": factors}});
    let one = |plies: Value| {
        press(|s| {
            s["sheets"].as_array_mut().unwrap().pop();
            s["friction"] = json!({"tool_fabric": 0.2, "fabric_fabric": plies});
            s["sheets"][0]["regions"] = json!([{"name": "r", "rectangle": {"length": "20 mm", "width": "20 mm"}, "friction": {"all": law}}]);
        })
    };
    assert_eq!(refused(one(Value::Null)), Ok(()));
    assert_refused(
        one(json!(0.3)),
        Rule::Friction,
        &["`a` and `a` both have fibres"],
    );
}

#[test]
fn a_law_in_a_region_is_checked_as_any_other() {
    let with = |law: Value| {
        press(|s| {
            s["sheets"][0]["regions"] = json!([{"name": "r", "rectangle": {"length": "20 mm", "width": "20 mm"}, "friction": {"tool": law}}]);
        })
    };
    let table = |k: f64| json!({"pressure": {"table": [{"pressure": "1 kPa", "coefficient": 0.3}, {"pressure": format!("{k} kPa"), "coefficient": 0.2}]}});
    assert_eq!(refused(with(table(2.0))), Ok(()));
    assert_refused(
        with(table(1.0)),
        Rule::Friction,
        &[
            "sheets[0].regions[0].friction.tool.pressure.table[1].pressure",
            "more than the 1000 Pa of the row before",
        ],
    );
}

#[test]
fn what_lies_beside_mirror_planes_is_its_own_image() {
    let with = |planes: Value, change: &dyn Fn(&mut Value)| {
        bag(|s| {
            s["symmetry"] = planes;
            change(s);
        })
    };
    let both = || json!(["x", "y"]);
    assert_eq!(refused(with(both(), &|_| ())), Ok(()));
    let angle = json!({"coefficient": 0.3, "angle": {"factors": [{"angle": "0 deg", "factor": 1}, {"angle": "90 deg", "factor": 1.2}]}});
    let turned = |s: &mut Value| {
        (s["sheets"][1]["fibre_1"], s["sheets"][1]["fibre_2"]) =
            (json!("-45 deg"), json!("45 deg"));
    };
    assert_eq!(refused(with(both(), &turned)), Ok(()));
    let cases: [(Value, Change, &str); 8] = [
        (json!(["x", "x"]), &|_| (), "named twice"),
        (
            both(),
            &|s| s["sheets"][2]["centre"] = json!(["5 mm", "0 mm"]),
            "symmetry[0]: ply `b`: the blank",
        ),
        (
            both(),
            &|s| s["sheets"][2]["centre"] = json!(["0 mm", "5 mm"]),
            "symmetry[1]: ply `b`: the blank",
        ),
        (
            json!(["y"]),
            &|s| {
                s["sheets"][1]["regions"] = json!([{"name": "r", "rectangle": {"centre": ["0 mm", "20 mm"], "length": "20 mm", "width": "20 mm"}, "friction": {"all": 0.1}}]);
            },
            "region `r` of ply `a` has no mirror image",
        ),
        (
            json!(["x"]),
            &|s| {
                (s["sheets"][1]["fibre_1"], s["sheets"][1]["fibre_2"]) =
                    (json!("30 deg"), json!("120 deg"))
            },
            "sheet `a` (fibre_1 at 30 deg)",
        ),
        (
            json!(["x"]),
            &|s| {
                turned(s);
                s["friction"]["fabric_diaphragm"] = angle.clone();
            },
            "exchanges with the other one in sheet `a`",
        ),
        (
            json!(["x"]),
            &|s| {
                turned(s);
                s["sheets"][2]["regions"] = json!([{"name": "r", "rectangle": {"length": "20 mm", "width": "20 mm"}, "friction": {"high": angle.clone()}}]);
            },
            "exchanges with the other one",
        ),
        (
            json!(["y"]),
            &|s| s["tool"] = json!({"tetrahedron": {"edge": "200 mm", "height": "160 mm", "radius": "10 mm", "facet_size": "5 mm"}}),
            "the tool is not its own mirror image in the plane y = 0",
        ),
    ];
    for (planes, change, says) in cases {
        assert_refused(with(planes, change), Rule::Symmetry, &[says]);
    }
}

#[test]
fn tools_that_cannot_be_built_are_refused_by_their_words() {
    let spar = |key: &str, value: &str| {
        bag(|s| {
            let mut spar = json!({"length": "400 mm", "top_width": "100 mm", "height": "40 mm", "draft": "5 deg", "fillet": "8 mm",
                "joggles": [], "facet_size": "5 mm"});
            spar[key] = json!(value);
            s["tool"] = json!({"joggle_spar": spar});
        })
    };
    assert_eq!(refused(spar("draft", "57 deg")), Ok(()));
    for (key, value, says) in [
        ("draft", "58 deg", "between 0 deg and 57 deg"),
        ("fillet", "0 mm", "more than 0 mm"),
        ("fillet", "41 mm", "at most `height` (40 mm)"),
        ("top_width", "20 mm", "more than"),
        ("corner", "1 mm", "corner: given 1 mm"),
        ("length", "30 mm", "two rounded ends"),
    ] {
        let path = format!("tool.joggle_spar.{key}");
        assert_refused(spar(key, value), Rule::Tool, &[&path, says]);
    }
}

#[test]
fn a_class_is_needed_unless_all_its_neighbours_are_pairs() {
    let with = |pairs: Value| {
        bag(|s| {
            s["friction"]["pairs"] = pairs;
            s["friction"]
                .as_object_mut()
                .unwrap()
                .remove("fabric_fabric");
        })
    };
    let pair = json!([{"between": ["b", "a"], "coefficient": 0.3}]);
    assert_eq!(refused(with(pair)), Ok(()));
    let ends = [["tool", "a"], ["holder", "a"], ["b", "die"]];
    let ends = ends.map(|between| json!({"between": between, "coefficient": 0.2}));
    let rigid = press(|s| s["friction"] = json!({"fabric_fabric": 0.3, "pairs": ends}));
    assert_eq!(refused(rigid), Ok(()));
    assert_refused(
        with(json!([])),
        Rule::Friction,
        &[
            "friction.fabric_fabric: `fabric_fabric` is missing",
            "`a` and `b` touch",
        ],
    );
}
