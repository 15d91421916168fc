//! Materials.

use crate::common::*;
use crate::fabric_support::{every_shear_law, sheet};
use crate::support::{
    BATCHES, Both, Buffers, Compiled, LANES as WIDE, Random, compiled, curvature, metric,
};
use plyflow_kernels::fabric::Fabric;
use plyflow_kernels::fabric_linear::FabricLinear;
use plyflow_kernels::isotropic::Isotropic;
use plyflow_kernels::marlow::Marlow;
use plyflow_kernels::record;
use plyflow_sdk::{Aligned, BendingBatch, Material, MembraneBatch};
use plyflow_tape::Tape;
use serde_json::{Value, json};

/// A state goes on, or another one begins.
fn next(random: &mut Random, now: [f64; 3], of: fn(&mut Random) -> [f64; 3]) -> [f64; 3] {
    if random.chance(0.6) {
        return now.map(|x| x + 0.02 * random.between(-1.0, 1.0) * (1.0 + x.abs()));
    }
    of(random)
}

/// Rows of lanes from one triple a lane.
fn put(rows: &mut [f64], lane: usize, values: [f64; 3]) {
    for (r, value) in values.into_iter().enumerate() {
        rows[r * WIDE + lane] = value;
    }
}

fn hold_membrane<M: Material>(
    material: &M,
    tape: &Tape,
    compiled: &Compiled,
    name: &str,
    seldom: usize,
) {
    let mut both = Both::new(tape, compiled, name);
    let mut random = Random::new(7);
    let mut now = [[1.0, 1.0, 0.0]; WIDE];
    let mut history = Aligned::zeros(material.sizes().membrane_history * WIDE);
    for _ in 0..BATCHES {
        // Now and then a fresh ply.
        if random.chance(0.02) {
            history.fill(0.0);
        }
        let mut before = Buffers::new(tape);
        for (lane, state) in now.iter_mut().enumerate() {
            *state = next(&mut random, *state, metric);
            put(before.get_mut("metric"), lane, *state);
        }
        before.get_mut("history").copy_from_slice(&history);
        before.get_mut("dt")[0] = 1e-6;
        let (mut stress, mut energy) = (Aligned::zeros(3 * WIDE), Aligned::zeros(WIDE));
        let mut stiffness = Aligned::zeros(2 * WIDE);
        material.membrane(&mut MembraneBatch {
            lanes: WIDE,
            dt: 1e-6,
            metric: before.get("metric"),
            history: &mut history,
            stress: &mut stress,
            energy: &mut energy,
            stiffness: Some(&mut stiffness),
        });
        let wanted: [(&str, &[f64]); 4] = [
            ("stress", &stress),
            ("energy", &energy),
            ("stiffness", &stiffness),
            ("history", &history),
        ];
        both.hold(&before, &wanted);
        // A state that has become a NaN stays one.
        for x in history.iter_mut().filter(|x| !x.is_finite()) {
            *x = 0.0;
        }
    }
    both.all_taken(1000, seldom);
}

fn hold_bending<M: Material>(material: &M, tape: &Tape, compiled: &Compiled, name: &str) {
    let mut both = Both::new(tape, compiled, name);
    let mut random = Random::new(8);
    let mut now = [[0.0; 3]; WIDE];
    let mut history = Aligned::zeros(material.sizes().bending_history * WIDE);
    for _ in 0..BATCHES {
        let mut before = Buffers::new(tape);
        for (lane, state) in now.iter_mut().enumerate() {
            *state = next(&mut random, *state, curvature);
            put(before.get_mut("curvature"), lane, *state);
            put(before.get_mut("metric"), lane, metric(&mut random));
        }
        before.get_mut("history").copy_from_slice(&history);
        let (mut moment, mut energy) = (Aligned::zeros(3 * WIDE), Aligned::zeros(WIDE));
        let mut tangent = Aligned::zeros(3 * WIDE);
        material.bending(&mut BendingBatch {
            lanes: WIDE,
            dt: 0.0,
            metric: before.get("metric"),
            curvature: before.get("curvature"),
            history: &mut history,
            moment: &mut moment,
            energy: &mut energy,
            tangent: Some(&mut tangent),
        });
        let wanted: [(&str, &[f64]); 4] = [
            ("moment", &moment),
            ("energy", &energy),
            ("tangent", &tangent),
            ("history", &history),
        ];
        both.hold(&before, &wanted);
    }
    both.all_taken(1000, 0);
}

/// The stitch has passed its onset wherever it is asked for the work that it has done: one choice stands that cannot go the other way.
const STITCH: usize = 1;
/// No strain lies before the first point of a film's table.
const FIRST_POINT: usize = 1;

/// Holds a material's membrane, and its bending where it has one, against what is recorded of them. So many choices go one way alone.
fn hold<M: Material>(name: &str, json: &str, seldom: usize) {
    let material = M::create(json).unwrap_or_else(|why| panic!("{name}: {why}"));
    let membrane = record::membrane(&material, true).unwrap_or_else(|why| panic!("{name}: {why}"));
    let bending = material
        .sizes()
        .has_bending
        .then(|| record::bending(&material).unwrap_or_else(|why| panic!("{name}: {why}")));
    let mut functions = vec![("membrane", &membrane)];
    functions.extend(bending.as_ref().map(|tape| ("bending", tape)));
    let compiled = compiled(&functions);
    hold_membrane(&material, &membrane, &compiled, "membrane", seldom);
    if let Some(tape) = &bending {
        hold_bending(&material, tape, &compiled, "bending");
    }
    println!("{name}: {:?}", membrane.counts());
}

#[test]
fn fabrics_with_every_shear_law_give_their_bits() {
    for (i, (name, shear, stitch)) in every_shear_law().into_iter().enumerate() {
        let ply = sheet("fibre-energy", &shear, stitch);
        let seldom = if ply.get("stitch").is_some() {
            STITCH
        } else {
            0
        };
        hold::<Fabric>(&format!("law {i}: {name}"), &ply.to_string(), seldom);
    }
}

#[test]
fn hypoelastic_fabrics_give_their_bits() {
    hold::<Fabric>("NCF", &ncf("hypoelastic", ""), 0);
    hold::<Fabric>("woven", &woven("hypoelastic"), 0);
}

#[test]
fn bending_by_voce_by_tables_and_with_friction_gives_its_bits() {
    hold::<Fabric>("Voce", &ncf("fibre-energy", ""), STITCH);
    hold::<Fabric>("one Voce", &woven("fibre-energy"), 0);
    let table = json!({"table": {"curvatures": [0.0, 10.0, 30.0, 100.0], "moments": [0.0, 1e-3, 2e-3, 3e-3]}});
    let friction = json!({"moment": 1e-3, "curvature": 1.0});
    let laws = json!({
        "family_1": {"positive": table, "negative": {"linear": 1e-4, "asymptote": 0.01, "scale": 10.0}, "hysteresis": friction},
        "family_2": {"positive": {"stiffness": 2e-4}},
        "positive_face": "up",
        "twist_stiffness": 1e-5
    });
    hold::<Fabric>(
        "tables and friction",
        &with_bending(&laws, None).to_string(),
        0,
    );
    hold::<Fabric>(
        "families at 60 deg",
        &with_bending(&laws, Some(60.0)).to_string(),
        0,
    );
}

/// A woven ply with these laws of bending, whose families cross at an angle (degrees).
fn with_bending(laws: &Value, crossing: Option<f64>) -> Value {
    let mut ply = sheet(
        "fibre-energy",
        &json!({"coefficients": [0.0, 60.0, 0.0, 120.0], "limit": 1.3}),
        None,
    );
    ply["bending"] = laws.clone();
    if let Some(degrees) = crossing {
        ply["crossing"] = json!(degrees.to_radians());
    }
    ply
}

#[test]
fn friction_between_yarns_fibres_that_crush_and_families_at_any_angle_give_their_bits() {
    let shear = json!({"coefficients": [0.0, 60.0, 0.0, 120.0], "limit": 1.3,
        "hysteresis": {"force": 5.0, "angle": 0.02, "per_tension": 0.01}});
    let crush =
        json!({"table": {"strains": [0.0, 0.01, 0.05, 0.2], "stresses": [0.0, 6e6, 9e6, 1e7]}});
    let mut ply = sheet("fibre-energy", &shear, None);
    hold::<Fabric>("friction", &ply.to_string(), 0);
    ply["compression"] = crush;
    hold::<Fabric>("friction and fibres that crush", &ply.to_string(), 0);
    ply["crossing"] = json!(120f64.to_radians());
    hold::<Fabric>("all of it at 120 deg", &ply.to_string(), 0);
}

#[test]
fn films_and_plates_give_their_bits() {
    hold::<Marlow>("exponential", FILM, 0);
    let table = r#"{"uniaxial":{"strains":[0,0.1,0.5,1.5],"stresses":[0,2e6,4e6,9e6]},"thickness":8e-5,"areal_mass":0.08}"#;
    hold::<Marlow>("table", table, FIRST_POINT);
    let plate = r#"{"youngs_modulus":2e9,"poisson_ratio":0.3,"thickness":1e-3,"areal_mass":1.2}"#;
    hold::<Isotropic>("plate", plate, 0);
    let linear = r#"{"fibre_modulus_1":3e9,"fibre_modulus_2":2e9,"shear_modulus":1e6,"thickness":4e-4,"areal_mass":0.44}"#;
    hold::<FabricLinear>("linear", linear, 0);
}
