//! Parameters of type `sheet_material`: a file, a material, or a file with other parameters.

mod common;

use common::Study;
use plyflow_model::manifest::Manifest;
use plyflow_workflow::Diagnostics;
use serde_json::{Value, json};

const COUPON: &str = r#"{"name": "coupon-test", "version": "1", "kind": "step", "role": "coupon", "summary": "s",
    "parameters": {"material": {"type": "sheet_material", "required": true, "doc": "Of the specimen."}},
    "output": {"kind": "coupon"}}"#;

fn resolved(material: &str) -> Result<Value, Diagnostics> {
    let study = Study::sound();
    let workflow = format!(
        "plyflow: 1\nname: c\nsteps:\n  pull:\n    plugin: coupon-test\n    with:\n      material: {material}\n"
    );
    study.write("workflow.yaml", &workflow);
    let mut catalog = common::catalog();
    catalog.0.push(Manifest::parse(COUPON).unwrap());
    let w = plyflow_workflow::load(&study.path("workflow.yaml"), &catalog)?;
    Ok(w.steps[0].parameters["material"].clone())
}

#[test]
fn file_gives_the_material_of_the_file() {
    let m = resolved("materials/fabric.yaml").unwrap();
    assert_eq!(m["with"], json!({"fibre_modulus": 3e9, "shear": 112.19}));
    assert_eq!(
        (&m["thickness"], &m["name"]),
        (&json!("0.0004 m"), &json!("NCF"))
    );
}

#[test]
fn parameters_take_the_place_of_those_of_the_file() {
    let m = resolved("{file: materials/fabric.yaml, with: {fibre_modulus: 30 MPa, shear: null}}")
        .unwrap();
    assert_eq!(m["with"], json!({"fibre_modulus": 3e7}));
}

#[test]
fn material_may_stand_in_the_workflow() {
    let text = "{plyflow_material: 1, name: f, plugin: material-marlow, thickness: 80 um, areal_mass: 90 g/m2}";
    let m = resolved(text).unwrap();
    assert_eq!(m["with"], json!({"modulus": 3e6}));
}

#[test]
fn mistakes_are_named_where_they_stand() {
    for (text, place, message) in [
        ("3", "material: 3", "`material` is"),
        (
            "{file: materials/fabrik.yaml}",
            "materials/fabrik.yaml",
            "no such file",
        ),
        ("{file: materials/fabric.yaml, wiht: {}}", "wiht", "wiht"),
        (
            "{file: materials/fabric.yaml, with: {sheer: 1 N/m}}",
            "sheer",
            "no parameter of `material-fabric`",
        ),
        (
            "{file: materials/fabric.yaml, with: {fibre_modulus: 3 N}}",
            "3 N",
            "fibre_modulus",
        ),
        (
            "{file: materials/fabric.yaml, with: {fibre_modulus: null}}",
            "fibre_modulus",
            "needs the parameter",
        ),
        ("{file: materials/fabric.yaml, with: 7}", "7", "`with` is"),
    ] {
        let found = format!("{:?}", resolved(text).expect_err(text));
        assert!(
            found.contains(message) && found.contains(place),
            "{text}: {found}"
        );
    }
}
