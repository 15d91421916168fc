//! Regions of plies in a scene: which contacts and elements they reach, and that one over all of a ply is what the scene says of all of it.

use crate::common::scenes::{bag, hourglass, ply, press};
use crate::common::{BuiltIn, fabric, form, woven};
use plyflow_forming_explicit::{Parameters, build_global};
use plyflow_mechanics::contact::{FrictionLaw, Partner, RegionalFriction};
use plyflow_mechanics::model::Model;
use serde_json::{Value, json};
use std::sync::Arc;

fn rectangle(name: &str, size: [&str; 2], does: Value) -> Value {
    let mut region = json!({"name": name, "rectangle": {"length": size[0], "width": size[1]}});
    let map = region.as_object_mut().unwrap();
    map.extend(does.as_object().unwrap().clone());
    region
}

/// The beginning of a stroke on two plies, `inner` and `outer`, of 120 mm.
fn two(change: impl FnOnce(&mut Value)) -> Parameters {
    press(2, &json!({"gap": "0.002 m"}), |p| {
        let scene = &mut p["scene"];
        scene["tool"]["hemisphere"]["facet_size"] = json!("0.004 m");
        scene["sheets"] = ["inner", "outer"]
            .map(|n| ply(n, &fabric(), [0.12, 0.12], 0.3))
            .into();
        scene["friction"] = json!({"tool_fabric": 0.2, "fabric_fabric": 0.3});
        let press = &mut scene["process"]["press"];
        press["stroke"] = json!("0.008 m");
        press["forming_time"] = json!("0.03 s");
        press["settling_time"] = json!("0.001 s");
        p["element_size"] = json!(0.012);
        p["tool_grid"] = json!(0.004);
        p["frames"] = json!(2);
        change(p);
    })
}

fn model(p: &Parameters) -> Model {
    build_global(p, &BuiltIn).map(|f| f.model).unwrap()
}

fn law<'a>(model: &'a Model, name: &str) -> &'a FrictionLaw {
    let rigid = model
        .rigid_contacts()
        .iter()
        .map(|c| (&c.name, &c.friction));
    let sheets = model
        .sheet_contacts()
        .iter()
        .map(|c| (&c.name, &c.friction));
    let own = model.self_contacts().iter().map(|c| (&c.name, &c.friction));
    let found = rigid.chain(sheets).chain(own).find(|(n, _)| *n == name);
    found.unwrap_or_else(|| panic!("no contact {name}")).1
}

fn regional(model: &Model, name: &str) -> Arc<RegionalFriction> {
    match law(model, name) {
        FrictionLaw::Regional(law) => law.clone(),
        law => panic!("{name}: {law:?}"),
    }
}

fn constants(laws: &[FrictionLaw]) -> Vec<f64> {
    let of = |l: &FrictionLaw| match l {
        FrictionLaw::Constant(c) => *c,
        law => panic!("{law:?}"),
    };
    laws.iter().map(of).collect()
}

#[test]
fn a_region_reaches_its_plys_contacts_with_the_named_partners_and_no_others() {
    let slick = |partner: &str| json!({"friction": {partner: 0.05}});
    let with = |partner: &str| {
        let region = rectangle("a", ["0.05 m", "0.03 m"], slick(partner));
        model(&two(|p| {
            p["scene"]["sheets"][1]["regions"] = json!([region])
        }))
    };
    let m = with("inner");
    // The outer ply's nodes lie on the inner one.
    let between = regional(&m, "inner/outer");
    assert_eq!(constants(&between.laws), [0.3, 0.05]);
    assert!(matches!(between.partner, Partner::Bare));
    let start = m.start();
    for n in &m.sheets()[1].nodes {
        let [x, y, _] = start[*n as usize];
        let inside = x.abs() <= 0.025 + 1e-9 && y.abs() <= 0.015 + 1e-9;
        assert_eq!(between.slave.at(*n) == 1, inside, "({x}, {y})");
    }
    assert!(between.slave.inside() > 4);
    assert!(
        m.sheets()[0]
            .nodes
            .iter()
            .all(|n| between.slave.at(*n) == 0)
    );
    // What holds the outer ply through the inner one rubs as the weaker surface does, node by node.
    let through = regional(&m, "tool/outer");
    assert_eq!(constants(&through.laws), [0.2, 0.05]);
    assert_eq!(through.slave.inside(), between.slave.inside());
    for bare in [
        "tool/inner",
        "die/outer",
        "holder/inner",
        "inner/inner",
        "outer/outer",
    ] {
        assert!(matches!(law(&m, bare), FrictionLaw::Constant(_)), "{bare}");
    }
    let all = with("all");
    for reached in ["inner/outer", "die/outer", "outer/outer", "tool/outer"] {
        assert_eq!(
            regional(&all, reached).slave.inside(),
            between.slave.inside(),
            "{reached}"
        );
    }
    assert!(matches!(law(&all, "inner/inner"), FrictionLaw::Constant(_)));
    // Of the ply below: by its own nodes, where the other one's touch its cells; for what it holds off the tool by the place above it.
    let region = rectangle("a", ["0.05 m", "0.03 m"], slick("outer"));
    let m = model(&two(|p| {
        p["scene"]["sheets"][0]["regions"] = json!([region])
    }));
    let below = regional(&m, "inner/outer");
    let Partner::Sheet { laws, .. } = &below.partner else {
        panic!("{:?}", below.partner);
    };
    assert_eq!(
        (below.slave.inside(), laws.inside()),
        (0, between.slave.inside())
    );
    assert_eq!(
        regional(&m, "tool/outer").slave.inside(),
        between.slave.inside()
    );
}

#[test]
fn a_region_over_all_of_a_ply_gives_the_bits_of_the_same_coefficient_everywhere() {
    let places = |p: &Parameters| form(p, 2).0.model.x().to_vec();
    let plain = |mu: f64| two(|p| p["scene"]["friction"]["fabric_fabric"] = json!(mu));
    let lubricated = |ply: usize| {
        let all = rectangle(
            "all",
            ["0.12 m", "0.12 m"],
            json!({"friction": {"fabric_fabric": 0.05}}),
        );
        two(|p| {
            p["scene"]["sheets"][ply]["regions"] = json!([all]);
            // Folds of the other ply rub as the scene says: there are none.
            p["self_contact"] = json!(false);
        })
    };
    let mut everywhere = plain(0.05);
    everywhere.self_contact = false;
    let wanted = places(&everywhere);
    assert!(wanted == places(&lubricated(0)) && wanted == places(&lubricated(1)));
    let mut dry = plain(0.3);
    dry.self_contact = false;
    assert!(wanted != places(&dry), "friction does not matter here");
    // A part is neither.
    let half = rectangle(
        "half",
        ["0.04 m", "0.12 m"],
        json!({"friction": {"fabric_fabric": 0.05}}),
    );
    let mut part = two(|p| p["scene"]["sheets"][1]["regions"] = json!([half]));
    part.self_contact = false;
    let part = places(&part);
    assert!(part != wanted && part != places(&dry));
}

#[test]
fn stitches_removed_from_all_of_a_ply_give_the_bits_of_a_fabric_without_them() {
    for element in ["m4", "rf4", "s4"] {
        let with = |change: &dyn Fn(&mut Value)| {
            let p = two(|p| {
                p["element"]["plugin"] = json!(element);
                p["element"]["with"] = if element == "s4" {
                    json!({})
                } else {
                    hourglass(300.0)
                };
                for sheet in p["scene"]["sheets"].as_array_mut().unwrap() {
                    // A stitch that acts from the first shear on, and bending for shells.
                    let with = &mut sheet["material"]["with"];
                    with["stitch"] =
                        json!({"angles": [0.0, 0.5, 0.75], "forces": [0.0, 880.0, 0.0]});
                    with["bending"] = woven()["with"]["bending"].clone();
                }
                change(p);
            });
            form(&p, 2).0.model.x().to_vec()
        };
        let remove = |p: &mut Value, size: &str| {
            let region = rectangle("bare", [size, "0.12 m"], json!({"stitches": "removed"}));
            p["scene"]["sheets"][1]["regions"] = json!([region]);
        };
        let without = with(&|p| {
            let with = p["scene"]["sheets"][1]["material"]["with"].as_object_mut();
            with.unwrap().remove("stitch");
        });
        let all = with(&|p| remove(p, "0.12 m"));
        if element == "m4" {
            assert!(without == all, "{element}");
        } else {
            // What bends about nodes, or twists, keeps the ply's own law: within what that is.
            let apart = without
                .iter()
                .zip(&all)
                .flat_map(|(a, b)| (0..3).map(move |d| (a[d] - b[d]).abs()));
            let apart = apart.fold(0.0, f64::max);
            assert!(apart < 2e-4, "{element}: {apart} m");
        }
        let stitched = with(&|_| {});
        let part = with(&|p| remove(p, "0.04 m"));
        assert!(
            part != all && part != stitched && all != stitched,
            "{element}"
        );
    }
}

#[test]
fn regions_that_would_do_nothing_or_break_a_mirror_plane_are_refused() {
    let refused = |region: Value, symmetry: &[&str]| {
        let p = two(|p| {
            p["scene"]["sheets"][1]["regions"] = json!([region]);
            p["scene"]["symmetry"] = json!(symmetry);
            for sheet in p["scene"]["sheets"].as_array_mut().unwrap() {
                sheet["fibre_1"] = json!("0 rad");
                sheet["fibre_2"] = json!("1.5707963267948966 rad");
                sheet["material"] = woven();
            }
        });
        build_global(&p, &BuiltIn).err().map(|e| e.to_string())
    };
    let at = |x: &str, size: &str, does: Value| {
        let mut region = rectangle("a", [size, size], does);
        region["rectangle"]["centre"] = json!([x, "0 m"]);
        region
    };
    let slick = || json!({"friction": {"all": 0.1}});
    let text = refused(at("0.005 m", "0.004 m", slick()), &[]).unwrap();
    assert!(text.contains("holds no node"), "{text}");
    let text = refused(at("0 m", "0.2 m", slick()), &[]).unwrap();
    assert!(text.contains("reaches beyond the ply"), "{text}");
    let text = refused(at("0 m", "0.1 m", json!({"stitches": "removed"})), &[]).unwrap();
    assert!(text.contains("has no `stitch`"), "{text}");
    let text = refused(at("0.02 m", "0.04 m", slick()), &["x"]).unwrap();
    assert!(
        text.contains("no mirror image in the plane x = 0"),
        "{text}"
    );
    assert_eq!(refused(at("0.02 m", "0.04 m", slick()), &["y"]), None);
    assert_eq!(refused(at("0 m", "0.04 m", slick()), &["x", "y"]), None);
}

#[test]
fn a_film_slides_more_easily_over_a_lubricated_place_of_a_ply_in_a_bag() {
    let p = bag(1, |p| {
        let region = rectangle(
            "a",
            ["0.06 m", "0.04 m"],
            json!({"friction": {"upper": 0.1, "fabric_diaphragm": 0.2}}),
        );
        p["scene"]["sheets"][1]["regions"] = json!([region]);
    });
    let m = model(&p);
    assert_eq!(constants(&regional(&m, "upper/ply_1").laws), [0.4, 0.1]);
    assert_eq!(constants(&regional(&m, "lower/ply_1").laws), [0.4, 0.2]);
    // Between tool and film 0.5, film and ply 0.4 or 0.2.
    assert_eq!(constants(&regional(&m, "tool/ply_1").laws), [0.4, 0.2]);
    assert!(matches!(law(&m, "tool/lower"), FrictionLaw::Constant(mu) if *mu == 0.5));
}
