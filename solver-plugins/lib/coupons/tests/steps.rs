//! Coupons as steps. They give the same bytes for any number of threads: the pieces that threads share are larger than one
//! (batches of elements, blocks of nodes), so the meshes of these tests have more than a thousand nodes.

use plyflow_coupons::{
    bias_extension::Plugin as BiasExtension, bias_plane::Plugin as BiasPlane,
    buckling::Plugin as Buckling, cantilever::Plugin as Cantilever, film::Plugin as Film,
    friction::Plugin as Friction, inflation::Plugin as Inflation,
    picture_frame::Plugin as PictureFrame, pure_bending::Plugin as PureBending,
};
use plyflow_kernels::built_in::component;
use plyflow_sdk::Step;
use plyflow_testing::{Components, Machine, MemoryArtifact, MemoryInput, run_on};
use serde_json::{Value, json};

/// One thread, with Plyflow's own components.
const ALONE: Machine = Machine {
    threads: 1,
    cancelled: false,
    // SAFETY: Plyflow's own, which are static.
    components: unsafe { Components::new(component) },
};

fn element(name: &str) -> Value {
    json!({"plugin": name, "with": {"hourglass": 1.0, "hourglass_floor": 3000.0, "hourglass_normal": 0.01}})
}

fn ncf() -> Value {
    json!({
        "plyflow_material": 1, "name": "NCF", "plugin": "material-fabric",
        "thickness": "0.0004 m", "areal_mass": "0.44 kg/m2",
        "with": {
            "form": "fibre-energy", "fibre_modulus": 3e9, "compression_factor": 1.0,
            "shear": {"coefficients": [0.0, 112.19, 94.73, 137.06, -65.56, 29.56]},
            "stitch": {"angles": [0.06, 0.5, 0.75], "forces": [0.0, 880.0, 0.0]},
            "bending": {"positive": {"linear": 0.00019457, "asymptote": 0.03139, "scale": 4.0}}
        }
    })
}

fn film() -> Value {
    json!({
        "plyflow_material": 1, "name": "film", "plugin": "material-marlow",
        "thickness": "8e-05 m", "areal_mass": "0.08 kg/m2",
        "with": {"uniaxial": {"amplitude": 6.364e6, "growth": 0.4451, "decay": 7.545}, "limit": 5.0}
    })
}

/// Everything that an artifact holds, with numbers as their bits.
fn content(a: &MemoryArtifact) -> Vec<(String, Vec<u64>)> {
    let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let mut list: Vec<(String, Vec<u64>)> = (a.arrays.iter())
        .map(|(name, (_, values))| (name.clone(), bits(values)))
        .collect();
    list.extend((a.results.iter()).map(|(name, (v, _))| (format!("result {name}"), bits(&[*v]))));
    list.push(("times".into(), bits(&a.times)));
    for body in &a.bodies {
        for (k, frame) in body.frames.iter().enumerate() {
            list.push((format!("frame {k}"), bits(frame.as_flattened())));
        }
        for (k, fields) in body.fields.iter().enumerate() {
            let named =
                |f: &plyflow_testing::MemoryField| (format!("{} {k}", f.name), bits(&f.values));
            list.extend(fields.iter().map(named));
        }
    }
    list.push((a.attributes.to_string(), Vec::new()));
    list
}

fn same_on_one_and_two_threads<S: Step>(parameters: &Value) {
    let with = |threads| {
        let machine = Machine { threads, ..ALONE };
        run_on::<S>(&machine, parameters.clone(), &[], &[]).unwrap_or_else(|e| panic!("{e}"))
    };
    let (one, two) = (with(1), with(2));
    let (one, two) = (content(&one), content(&two));
    assert_eq!(one.len(), two.len());
    assert!(one.len() > 20, "{} entries", one.len());
    for (a, b) in one.iter().zip(&two) {
        assert!(a == b, "'{}' differs from '{}'", a.0, b.0);
    }
}

#[test]
fn same_bytes_on_one_and_two_threads_picture_frame() {
    same_on_one_and_two_threads::<PictureFrame>(&json!({
        "material": ncf(), "element": element("rf4"), "element_size": 0.145 / 34.0,
        "path": [0.6, 0.3], "leg_time": 0.0015, "frames": 3
    }));
}

#[test]
fn same_bytes_on_one_and_two_threads_bias_extension_with_a_turned_mesh() {
    same_on_one_and_two_threads::<BiasPlane>(&json!({
        "material": ncf(), "element": element("m4"), "element_size": 0.005, "extension": 0.02,
        "time": 0.002, "mesh_angle": 0.4, "frames": 3
    }));
}

#[test]
fn same_bytes_on_one_and_two_threads_film_and_disc() {
    same_on_one_and_two_threads::<Film>(&json!({
        "material": film(), "element": element("m4"), "element_size": 0.002, "mode": "planar",
        "length": 0.075, "width": 0.075, "strain": 1.0, "time": 0.005, "frames": 3
    }));
    same_on_one_and_two_threads::<Inflation>(&json!({
        "material": film(), "element": element("m4"), "element_size": 0.005, "pressure": 2000.0,
        "ramp_time": 0.006, "hold_time": 0.001, "frames": 3
    }));
}

/// A soft belt, block or stack of the fabric, with membranes.
fn sliding(case: &str, mut more: Value) -> Value {
    let mut material = ncf();
    material["with"]["fibre_modulus"] = json!(3e8);
    more["material"] = material;
    more["case"] = json!(case);
    more["element"] = element("m4");
    more
}

#[test]
fn friction_follows_its_closed_forms_and_a_block_stays_below_its_angle() {
    let run = |with: Value| run_on::<Friction>(&ALONE, with, &[], &[]).unwrap();
    let belt = json!({"coefficient": 0.5, "element_size": 0.005, "time_step": 5e-6});
    let belt = run(sliding("capstan", belt));
    assert!(belt.result("friction_error") < 0.03);
    let law = (0.5 * std::f64::consts::FRAC_PI_2).exp();
    assert!((belt.result("force_ratio_law") - law).abs() < 1e-12);

    let slope = |degrees: f64| {
        let with = json!({"coefficient": 0.4, "slope": degrees.to_radians(), "element_size": 0.01, "time_step": 1e-5});
        run(sliding("incline", with))
    };
    let (stays, slides) = (slope(21.5), slope(30.0));
    assert!(stays.result("slid").abs() < 2e-6);
    assert!(!stays.results.contains_key("friction_error"));
    assert!(slides.result("friction_error") < 0.01);
    assert!(slides.result("slid") > 1e-3);

    let stack =
        json!({"coefficient": 0.3, "pressure": 2e4, "element_size": 0.01, "time_step": 1e-5});
    let stack = run(sliding("stack", stack));
    assert!(stack.result("friction_error") < 0.01);
    assert!((stack.result("pulling_force_law") - 30.0).abs() < 1e-9);
}

#[test]
fn same_bytes_on_one_and_two_threads_a_stack_of_three_sheets() {
    let with = json!({"coefficient": 0.3, "element_size": 0.003, "time_step": 2e-5, "frames": 3});
    same_on_one_and_two_threads::<Friction>(&sliding("stack", with));
}

#[test]
fn a_disc_beyond_its_limit_point_stops_with_a_statement() {
    let with = json!({
        "material": film(), "element": element("m4"), "element_size": 0.02, "pressure": 12000.0,
        "ramp_time": 0.1, "hold_time": 0.1, "frames": 3
    });
    let run = run_on::<Inflation>(&ALONE, with, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(run.result("ran_away"), 1.0);
    assert!(run.result("centre_height") < 0.2);
    assert!(
        run.log.iter().any(|l| l.contains("the disc ran away")),
        "{:?}",
        run.log
    );
}

#[test]
fn the_force_of_a_leg_is_that_of_its_own_part_of_the_path() {
    // 15 legs, of which 400 samples are no multiple: to and fro, the last to a smaller angle than all others.
    let mut path: Vec<f64> = (0..14).map(|k| [0.6, 0.2][k % 2]).collect();
    path.push(0.4);
    // Without a stitch the yarns' force is that of the angle alone.
    let mut material = ncf();
    material["with"]["stitch"] = Value::Null;
    let with = json!({
        "material": material, "element": element("m4"), "element_size": 0.145 / 4.0,
        "path": path, "leg_time": 0.02, "frames": 1
    });
    let run = run_on::<PictureFrame>(&ALONE, with.clone(), &[], &[]).unwrap();
    let force = |g: f64| {
        let c = [0.0, 112.19, 94.73, 137.06, -65.56, 29.56];
        c.iter().rev().fold(0.0, |s, c| s * g + c)
    };
    for (k, largest) in [(1, 0.6), (2, 0.6), (8, 0.6), (14, 0.6), (15, 0.4)] {
        let told = run.result(&format!("leg_force.{k}"));
        assert!(
            (told / force(largest) - 1.0).abs() < 0.05,
            "leg {k}: {told} N/m"
        );
    }
    let mut many = with;
    many["path"] = json!(vec![0.1; 401]);
    let error = run_on::<PictureFrame>(&ALONE, many, &[], &[]).unwrap_err();
    assert!(error.contains("path: given 401 angles"), "{error}");
}

#[test]
fn a_specimen_is_measured_where_it_takes_one_step_between_samples() {
    let with = json!({
        "material": ncf(), "element": element("rf4"), "element_size": 0.145, "path": [0.6],
        "leg_time": 0.004, "frames": 1
    });
    let run = run_on::<PictureFrame>(&ALONE, with, &[], &[]).unwrap();
    // All but the first, which has no steps before it.
    assert!(run.arrays["curves/run/shear_angle"].1.len() >= 399);
    assert!(run.result("force_peak") > 1.0);
}

#[test]
fn a_test_of_bending_refuses_what_does_not_bend() {
    type Run = fn(&Machine, Value, &[MemoryInput<'_>], &[u64]) -> Result<MemoryArtifact, String>;
    let mut flat = ncf();
    flat["with"]["bending"] = Value::Null;
    let refused = |material: &Value, element_name: &str, name: &str| {
        let (run, required) = match name {
            "bending" => (run_on::<PureBending> as Run, json!({"path": [20.0]})),
            "cantilever" => (run_on::<Cantilever> as Run, json!({"overhang": 0.1})),
            _ => (
                run_on::<BiasExtension> as Run,
                json!({"length": 0.15, "width": 0.05, "displacement": 0.01}),
            ),
        };
        let mut with = required;
        with["material"] = material.clone();
        with["element"] = element(element_name);
        run(&ALONE, with, &[], &[]).unwrap_err()
    };
    for name in ["bending", "cantilever", "bias extension"] {
        let error = refused(&flat, "rf4", name);
        assert!(
            error.contains("given 'rf4', which bends, and material 'NCF', which has no bending"),
            "{name}: {error}"
        );
    }
    for name in ["bending", "cantilever"] {
        let error = refused(&ncf(), "m4", name);
        assert!(error.contains("given 'm4', a membrane"), "{name}: {error}");
    }
}

#[test]
fn a_size_a_thousandfold_too_small_is_refused_before_any_element_is_made() {
    type Run = fn(&Machine, Value, &[MemoryInput<'_>], &[u64]) -> Result<MemoryArtifact, String>;
    let of = |run: Run, material: Value, element_name: &str, mut with: Value| {
        with["material"] = material;
        with["element"] = element(element_name);
        with["element_size"] = json!(4e-6);
        let error = run(&ALONE, with, &[], &[]).unwrap_err();
        for part in [
            "the mesh of the specimen would have",
            "elements at `element_size`",
            "Take `element_size` of at least",
        ] {
            assert!(error.contains(part), "{error}");
        }
    };
    let pull = json!({"length": 0.15, "width": 0.05, "displacement": 0.01});
    of(
        run_on::<PictureFrame>,
        ncf(),
        "m4",
        json!({"path": [0.6], "leg_time": 0.004}),
    );
    of(run_on::<BiasExtension>, ncf(), "rf4", pull);
    of(
        run_on::<BiasPlane>,
        ncf(),
        "m4",
        json!({"extension": 0.02, "time": 0.002}),
    );
    of(
        run_on::<Cantilever>,
        ncf(),
        "rf4",
        json!({"overhang": 0.1, "width": 0.05}),
    );
    of(run_on::<PureBending>, ncf(), "rf4", json!({"path": [20.0]}));
    of(
        run_on::<Film>,
        film(),
        "m4",
        json!({"mode": "planar", "length": 0.075, "width": 0.075, "strain": 1.0, "time": 0.005}),
    );
    of(
        run_on::<Inflation>,
        film(),
        "m4",
        json!({"pressure": 2000.0, "ramp_time": 0.006, "hold_time": 0.001}),
    );
}

/// A strip with a stiffness of 8 N mm, softer along its fibres for the step.
fn strip(element: &str) -> Value {
    let mut material = ncf();
    material["with"]["fibre_modulus"] = json!(3e8);
    material["with"]["bending"] = json!({"positive": {"stiffness": 0.008}});
    json!({
        "material": material, "element": {"plugin": element, "with": {"hourglass": 1.0, "hourglass_floor": 3000.0}},
        "element_size": 0.005, "length": 0.1, "width": 0.01, "family": 1, "shortening": 0.1, "time": 0.3, "settling_time": 0.02,
        "foundation_thickness": 0.001, "disturbance": 10.0, "stiffness": 0.008, "step_safety": 0.8, "damping": 5.0, "frames": 3,
        "kinetic_bound": 0.05
    })
}

#[test]
fn a_strip_buckles_under_eulers_load_and_goes_on_as_the_elastica() {
    for element in ["rf4", "s4"] {
        let run =
            run_on::<Buckling>(&ALONE, strip(element), &[], &[]).unwrap_or_else(|e| panic!("{e}"));
        // 20 elements; 40 are held to a quarter of this in workflows/coupons/buckling.
        assert!(run.result("critical_load_error") < 0.04, "{element}");
        assert!(run.result("load_error_at_end") < 0.08, "{element}");
        assert!(run.result("amplitude_error_at_end") < 0.08, "{element}");
        assert!(run.result("drift_ratio") < 0.01, "{element}");
    }
}

#[test]
fn a_membrane_is_not_asked_to_buckle_without_a_word() {
    let error = run_on::<Buckling>(&ALONE, strip("m4"), &[], &[]).err();
    let error = error.map(|e| e.to_string()).unwrap_or_default();
    assert!(error.contains("a membrane, which does not bend"), "{error}");
}

#[test]
fn same_bytes_on_one_and_two_threads_buckling() {
    let mut with = strip("rf4");
    for (name, value) in [
        ("element_size", 0.0025),
        ("width", 0.06),
        ("time", 0.004),
        ("settling_time", 0.001),
    ] {
        with[name] = json!(value);
    }
    same_on_one_and_two_threads::<Buckling>(&with);
}

#[test]
fn a_strip_on_springs_that_has_not_buckled_gives_no_wave_length() {
    let mut with = strip("rf4");
    with["foundation_modulus"] = json!(15e3);
    with["shortening"] = json!(0.001);
    let error = run_on::<Buckling>(&ALONE, with, &[], &[]).err();
    let error = error.map(|e| e.to_string()).unwrap_or_default();
    assert!(error.contains("did not buckle"), "{error}");
}
