//! The manifests of the component plugins against the model's rules and against the code.

mod common;
use common::*;
use plyflow_kernels::{built_in, fabric::Fabric, m4::M4, m4f::M4f, marlow::Marlow, rf4::Rf4};
use plyflow_model::Manifest;
use plyflow_sdk::{Element, Material};

#[test]
fn manifests_obey_the_models_rules() {
    for component in built_in::all() {
        let name = component.name;
        let manifest =
            Manifest::parse(component.manifest).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(manifest.name, name);
    }
}

#[test]
fn fields_of_the_manifest_are_the_rows_that_the_elements_write() {
    let m = fabric(&ncf("fibre-energy", "")).unwrap();
    for (text, sizes) in [
        (M4::MANIFEST, El::new::<M4>("{}", &m).unwrap().sizes),
        (
            M4f::MANIFEST,
            El::new::<M4f>(r#"{"fibres_along_sides": true}"#, &m)
                .unwrap()
                .sizes,
        ),
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

/// The declaration of a list, by the names on the way to it.
fn items(manifest: &str, path: &[&str]) -> plyflow_model::manifest::Items {
    use plyflow_model::manifest::Shape;
    let manifest = Manifest::parse(manifest).unwrap();
    let mut fields = manifest.parameters;
    for (k, name) in path.iter().enumerate() {
        match fields.swap_remove(*name).unwrap().shape {
            Shape::Object(inner) => fields = inner,
            Shape::List(_, items) if k == path.len() - 1 => return items,
            other => panic!("{path:?}: {other:?}"),
        }
    }
    panic!("{path:?}")
}

#[test]
fn a_table_that_the_manifest_takes_is_not_too_long_for_the_material() {
    // Whatever else is wrong with so short a curve.
    let not_by_number =
        |refused: Option<String>| refused.is_none_or(|e| !e.contains("points; expected"));
    let column = |n: usize, step: f64| -> Vec<f64> { (0..n).map(|i| step * i as f64).collect() };
    let marlow = |n| {
        let table = serde_json::json!({"thickness": 5e-5, "areal_mass": 0.05, "uniaxial": {"strains": column(n, 0.01), "stresses": column(n, 1e5)}});
        not_by_number(Marlow::create(&table.to_string()).err())
    };
    let shear = |n| {
        let table = serde_json::json!({
            "fibre_modulus": 1e9, "thickness": 1e-3, "areal_mass": 0.1,
            "shear": {"table": {"angles": column(n, 0.01), "forces": column(n, 1.0)}},
        });
        not_by_number(Fabric::create(&table.to_string()).err())
    };
    let bending = |n| {
        let table = serde_json::json!({
            "fibre_modulus": 1e9, "thickness": 1e-3, "areal_mass": 0.1,
            "shear": {"coefficients": [0.0, 100.0]},
            "bending": {"positive": {"table": {"curvatures": column(n, 1.0), "moments": column(n, 1e-4)}}},
        });
        not_by_number(Fabric::create(&table.to_string()).err())
    };
    type Limit<'a> = (&'a str, &'a [&'a [&'a str]], &'a dyn Fn(usize) -> bool);
    let all: [Limit<'_>; 3] = [
        (
            Marlow::MANIFEST,
            &[&["uniaxial", "strains"], &["uniaxial", "stresses"]],
            &marlow,
        ),
        (
            Fabric::MANIFEST,
            &[&["shear", "table", "angles"], &["shear", "table", "forces"]],
            &shear,
        ),
        (
            Fabric::MANIFEST,
            &[
                &["bending", "positive", "table", "curvatures"],
                &["bending", "positive", "table", "moments"],
            ],
            &bending,
        ),
    ];
    for (manifest, paths, takes) in all {
        for path in paths {
            let items = items(manifest, path);
            for n in [2, 31, 32, 33, 41, 63, 64, 65] {
                assert_eq!(
                    items.broken_by_count(n).is_none(),
                    takes(n),
                    "{path:?} of {n}"
                );
            }
        }
    }
}
