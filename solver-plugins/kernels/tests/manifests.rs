//! The manifests of the component plugins against the model's rules and against the code.

mod common;
use common::*;
use plyflow_kernels::{fabric::Fabric, m4::M4, marlow::Marlow, rf4::Rf4};
use plyflow_model::Manifest;
use plyflow_sdk::{Element, Material};

#[test]
fn manifests_obey_the_models_rules() {
    for (name, text) in [
        ("m4", M4::MANIFEST),
        ("rf4", Rf4::MANIFEST),
        ("material-fabric", Fabric::MANIFEST),
        ("material-marlow", Marlow::MANIFEST),
    ] {
        let manifest = Manifest::parse(text).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(manifest.name, name);
    }
}

#[test]
fn fields_of_the_manifest_are_the_rows_that_the_elements_write() {
    let m = fabric(&ncf("fibre-energy", "")).unwrap();
    for (text, sizes) in [
        (M4::MANIFEST, El::new::<M4>("{}", &m).unwrap().sizes),
        (Rf4::MANIFEST, El::new::<Rf4>("{}", &m).unwrap().sizes),
    ] {
        let json: serde_json::Value = serde_json::from_str(text).unwrap();
        let fields = json["fields"].as_array().unwrap();
        let patch = fields.iter().filter(|f| f["patch"] == true).count();
        assert_eq!(patch, sizes.patch_fields as usize);
        assert_eq!(fields.len() - patch, sizes.fields as usize);
    }
}

#[test]
fn defaults_of_the_manifest_are_those_of_the_code() {
    let m = fabric(&ncf("fibre-energy", "")).unwrap();
    let q = [
        [0.0, 0.0, 0.0],
        [0.01, 0.0, 0.0],
        [0.01, 0.01, 0.0],
        [0.0, 0.01, 0.0],
    ];
    let constants = |json: &str| {
        let e = El::new::<M4>(json, &m).unwrap();
        e.initialise(&[q; 8], &[[1.0, 0.0, 0.0]; 8]).constants
    };
    let written = r#"{"hourglass":1.0,"hourglass_floor":3000.0,"hourglass_normal":0.01}"#;
    assert_eq!(constants("{}"), constants(written));
    for text in [M4::MANIFEST, Rf4::MANIFEST] {
        let p = &serde_json::from_str::<serde_json::Value>(text).unwrap()["parameters"];
        assert_eq!(p["hourglass"]["default"], 1.0);
        assert_eq!(p["hourglass_floor"]["default"], "3000 N/m");
        assert_eq!(p["hourglass_normal"]["default"], 0.01);
    }
}
