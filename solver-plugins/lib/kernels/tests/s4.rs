//! The element `s4` through its C table: gradients, invariance, patch tests, bounds.

mod common;
mod s4_support;
use common::*;
use plyflow_kernels::{Level, limit_level};
use plyflow_model::Manifest;
use s4_support::*;

#[test]
fn forces_and_moments_are_the_gradient_of_the_energy_with_total_moments() {
    let mut r = Random(101);
    for (m, json) in [
        (soft(), r#"{"bending":"total"}"#),
        (
            soft(),
            r#"{"bending":"total","twist":"material","hourglass":0.01}"#,
        ),
        (soft(), r#"{"thickening":1}"#),
        (soft(), r#"{"thickening":2}"#),
        (soft(), r#"{"thickening":2,"twist":"material"}"#),
        (plate(2e7, 0.3, 5e-4), PLATE),
    ] {
        let s = Shell::new(json, &m).unwrap();
        for round in 0..12 {
            let warp = if round % 2 == 0 { 0.0 } else { 0.1 };
            let reference: Vec<Quad> = (0..8).map(|_| uneven(&mut r, 0.2, warp)).collect();
            let mut b = s.start(&reference, AXIS);
            let x = bent(&mut r, &s, &mut b, &reference, 0.1, 0.2);
            let f = nudged(&s, &b, &x, 0, 0.0);
            for c in 0..24 {
                let h = if c < 12 { 1e-8 } else { 2e-6 };
                let (p, q) = (nudged(&s, &b, &x, c, h), nudged(&s, &b, &x, c, -h));
                for l in 0..8 {
                    let d = (p.total(l) - q.total(l)) / (2.0 * h);
                    let all = reaction(&f, l);
                    let kind = if c < 12 { 0..12 } else { 12..24 };
                    let scale = all[kind].iter().fold(0.0f64, |m, x| m.max(x.abs()));
                    assert!(
                        (d - all[c]).abs() < 2e-5 * scale,
                        "{json} dof {c}: {}, dW {d} of {scale}",
                        all[c]
                    );
                }
            }
        }
    }
}

#[test]
fn rigid_turns_of_any_size_give_no_force_also_to_warped_elements() {
    // 1000 steps through 5 turns, about an axis that itself wanders.
    let mut r = Random(102);
    for json in [r#"{"bending":"lagged-tangent"}"#, "{}"] {
        let m = ply();
        let s = Shell::new(json, &m).unwrap();
        let reference: Vec<Quad> = (0..8)
            .map(|l| uneven(&mut r, 0.25, 0.03 * l as f64))
            .collect();
        let mut b = s.start(&reference, AXIS);
        let mut x = reference.clone();
        let step = 10.0 * std::f64::consts::PI / 1000.0;
        let dt = 1e-4;
        for i in 0..1000 {
            let p = 0.003 * i as f64;
            let axis = [p.cos() * 0.6, p.sin() * 0.6, 0.8];
            let t = axis.map(|c| c * step);
            x.iter_mut().flatten().for_each(|y| *y = rotated(t, *y));
            let w = vec![[t.map(|c| c / dt); 4]; 8];
            let f = s.forces(&mut b, &x, &w, dt);
            // Rounding of the positions (1e-18 m) times the fibre stiffness, 1.2e6 N/m, grows.
            assert!(f.force.iter().all(|v| v.abs() < 1e-7), "{:?}", f.force);
            assert!(f.moment.iter().all(|v| v.abs() < 1e-12), "{:?}", f.moment);
            assert!(f.energy.iter().all(|v| v.abs() < 1e-14), "{:?}", f.energy);
        }
    }
}

#[test]
fn forces_balance_and_turn_with_a_deformed_element() {
    let mut r = Random(103);
    let m = soft();
    let s = Shell::new("{}", &m).unwrap();
    let reference: Vec<Quad> = (0..8).map(|_| uneven(&mut r, 0.2, 0.05)).collect();
    let mut b = s.start(&reference, AXIS);
    let x = bent(&mut r, &s, &mut b, &reference, 0.1, 0.2);
    let f = s.forces(&mut b, &x, &[STILL; 8], 1.0);
    let t = [0.7, -1.9, 0.4];
    let y: Vec<Quad> = x.iter().map(|q| q.map(|p| rotated(t, p))).collect();
    let g = s.forces(&mut b, &y, &[[t; 4]; 8], 1.0);
    for l in 0..8 {
        let largest = f.force.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut net = [0.0; 3];
        let mut torque = [0.0; 3];
        for i in 0..4 {
            let (p, q) = (Out::at(&f.force, i, l), Out::at(&f.moment, i, l));
            let arm = cross(x[l][i], p);
            for k in 0..3 {
                net[k] += p[k];
                torque[k] += arm[k] + q[k];
            }
            for (a, b) in [(&f.force, &g.force), (&f.moment, &g.moment)] {
                let want = rotated(t, Out::at(a, i, l));
                let got = Out::at(b, i, l);
                assert!(
                    (0..3).all(|k| (got[k] - want[k]).abs() < 1e-11 * largest),
                    "{got:?}, {want:?}"
                );
            }
        }
        assert!(
            net.iter().all(|v| v.abs() < 1e-12 * largest),
            "net force {net:?} N"
        );
        assert!(
            torque.iter().all(|v| v.abs() < 1e-13 * largest),
            "net moment {torque:?} N m"
        );
        assert!((f.total(l) - g.total(l)).abs() < 1e-11 * f.total(l));
    }
}

/// 3 x 3 distorted elements in two batches of 8, and the nodes of each.
fn patch(r: &mut Random) -> (Vec<V3>, Vec<[usize; 4]>) {
    let mut node = Vec::new();
    for j in 0..4 {
        for i in 0..4 {
            let inner = (1..3).contains(&i) && (1..3).contains(&j);
            let d = if inner { 0.25 } else { 0.0 };
            node.push([
                SIZE * (i as f64 + d * r.next()),
                SIZE * (j as f64 + d * r.next()),
                0.0,
            ]);
        }
    }
    let cell = |c: usize| {
        let a = c % 3 + 4 * (c / 3);
        [a, a + 1, a + 5, a + 4]
    };
    (node, (0..9).map(cell).collect())
}

struct Patched {
    /// Of the 16 nodes.
    force: Vec<V3>,
    moment: Vec<V3>,
    /// Of the 9 cells: the three rows.
    energy: Vec<[f64; 3]>,
    area: Vec<f64>,
    out: Out,
}

/// Moves a patch by `place` and turns its nodes by `turn`.
fn move_patch(
    s: &Shell,
    axis: V3,
    (node, cells): &(Vec<V3>, Vec<[usize; 4]>),
    place: &dyn Fn(V3) -> V3,
    turn: &dyn Fn(V3) -> V3,
) -> Patched {
    let quads = |f: &dyn Fn(V3) -> V3| -> Vec<Quad> {
        (0..16)
            .map(|l| cells[l.min(8)].map(|n| f(node[n])))
            .collect()
    };
    let mut b = s.start(&quads(&|x| x), axis);
    let out = s.forces(&mut b, &quads(place), &quads(turn), 1.0);
    let (mut force, mut moment) = (vec![[0.0; 3]; 16], vec![[0.0; 3]; 16]);
    for (l, cell) in cells.iter().enumerate() {
        for (i, n) in cell.iter().enumerate() {
            let (f, m) = (Out::at(&out.force, i, l), Out::at(&out.moment, i, l));
            (0..3).for_each(|k| force[*n][k] += f[k]);
            (0..3).for_each(|k| moment[*n][k] += m[k]);
        }
    }
    Patched {
        force,
        moment,
        energy: (0..9)
            .map(|l| [0, 1, 2].map(|r| out.energy[16 * r + l]))
            .collect(),
        area: (0..9).map(|l| b.constants[6 * 16 + l]).collect(),
        out,
    }
}

const INNER: [usize; 4] = [5, 6, 9, 10];

#[test]
fn patch_of_distorted_elements_carries_a_uniform_strain_exactly() {
    let mut r = Random(104);
    let s = Shell::new("{}", &ply()).unwrap();
    let p = patch(&mut r);
    // z = 0.1 x - 0.2 y: the directors turn to its normal (-0.1, 0.2, 1) (F^-T e3).
    let f = |[x, y, _]: V3| [1.03 * x + 0.08 * y, 0.05 * x + 0.98 * y, 0.1 * x - 0.2 * y];
    let normal = cross(f([1.0, 0.0, 0.0]), f([0.0, 1.0, 0.0]));
    let length = dot(normal, normal).sqrt();
    let angle = (normal[2] / length).acos();
    let axis = cross([0.0, 0.0, 1.0], normal);
    let size = dot(axis, axis).sqrt();
    let q = move_patch(&s, AXIS, &p, &f, &|_| axis.map(|c| c * angle / size));
    let largest = q.out.force.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    for n in INNER {
        assert!(
            q.force[n].iter().all(|v| v.abs() < 1e-10 * largest),
            "{:?} of {largest} N",
            q.force[n]
        );
    }
    assert!(
        q.out
            .moment
            .iter()
            .all(|v| v.abs() < 1e-12 * SIZE * largest)
    );
    assert!(
        q.energy
            .iter()
            .all(|[m, b, h]| *m > 1e-4 && b.abs() < 1e-16 && h.abs() < 1e-16)
    );
}

/// z = (k11 u^2 + k22 v^2) / 2 + k12 u v with normal directors, so small that only linear terms count.
fn quadratic(k: V3) -> (impl Fn(V3) -> V3, impl Fn(V3) -> V3) {
    let (c, s) = (AXIS[0], AXIS[1]);
    let slopes = move |x: f64, y: f64| {
        let (u, v) = (c * x + s * y, c * y - s * x);
        let (wu, wv) = (k[0] * u + k[2] * v, k[1] * v + k[2] * u);
        (0.5 * (wu * u + wv * v), c * wu - s * wv, s * wu + c * wv)
    };
    let place = move |[x, y, _]: V3| [x, y, slopes(x, y).0];
    // d = e3 - grad w = e3 + theta x e3.
    let turn = move |[x, y, _]: V3| [slopes(x, y).2, -slopes(x, y).1, 0.0];
    (place, turn)
}

#[test]
fn patch_of_distorted_elements_carries_constant_curvature_and_twist_exactly() {
    let mut r = Random(105);
    // Soft fibres, or rounding of the membrane's strain would hide the bending.
    let json = r#"{"fibre_modulus":1e4,"shear":{"coefficients":[0,200]},
        "bending":{"positive":{"linear":0.005}},"thickness":4e-4,"areal_mass":0.44}"#;
    let m = fabric(json).unwrap();
    let h = 4e-4f64;
    let c: f64 = 1.0 / 3.0;
    // dM12/dk12 of three layers: 4 w z^2 G.
    let layered = 4.0 * (0.5 * (1.0 - c)) * (0.25 * (1.0 + c) * h).powi(2) * 200.0;
    for (json, twist) in [
        (r#"{"hourglass_floor":0}"#, layered),
        (
            r#"{"hourglass_floor":0,"twist":"material"}"#,
            200.0 * h * h / 6.0,
        ),
    ] {
        let s = Shell::new(json, &m).unwrap();
        for _ in 0..5 {
            let p = patch(&mut r);
            for k in [
                [1e-3, 0.0, 0.0],
                [0.0, -1e-3, 0.0],
                [0.0, 0.0, 2e-3],
                [1e-3, 5e-4, -2e-3],
            ] {
                let (place, turn) = quadratic(k);
                let q = move_patch(&s, AXIS, &p, &place, &turn);
                let force = q.out.force.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                let moment = q.out.moment.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                for n in INNER {
                    // In the plane the force is of second order: what the chords' shortening gives.
                    // A patch that failed would show a part of D |k|; squares of the turns show 1e-8.
                    let shear = 0.005 * dot(k, k).sqrt();
                    assert!(
                        q.force[n][2].abs() < 1e-5 * moment / SIZE + 1e-7 * shear,
                        "{k:?}: {:?} N of {force}",
                        q.force[n]
                    );
                    assert!(
                        q.moment[n].iter().all(|v| v.abs() < 1e-5 * moment + 1e-15),
                        "{k:?}: {:?} N m of {moment}",
                        q.moment[n]
                    );
                }
                let w = 0.0025 * (k[0] * k[0] + k[1] * k[1]) + twist * k[2] * k[2];
                for (l, ([_, bending, hourglass], area)) in q.energy.iter().zip(&q.area).enumerate()
                {
                    let want = w * area;
                    // The layers' shear energies (G = 200 N/m) differ by little more than rounding.
                    let rounding = 200.0 * 2.0 * f64::EPSILON * area;
                    assert!(
                        (bending - want).abs() < 1e-5 * want + rounding,
                        "{k:?}: {bending} J, not {want}"
                    );
                    // Against D k^2, what its stiffness scales with; it comes from the squares of the
                    // turns (1e-5 rad), which straighten the directors.
                    let scale = 0.005 * area * dot(k, k);
                    assert!(
                        *hourglass < 1e-8 * scale,
                        "{k:?}: hourglass {hourglass} of {scale} J"
                    );
                    // The work of the nodal forces on this motion is twice the energy.
                    let work: f64 = (0..4)
                        .map(|i| {
                            let x = p.0[p.1[l][i]];
                            Out::at(&q.out.force, i, l)[2] * place(x)[2]
                                + dot(Out::at(&q.out.moment, i, l), turn(x))
                        })
                        .sum();
                    assert!(
                        (work - 2.0 * want).abs() < 1e-5 * want,
                        "{k:?}: work {work} J, not {}",
                        2.0 * want
                    );
                }
                for (l, a) in (0..9).flat_map(|l| [(l, 0), (l, 1)]) {
                    let got = q.out.fields[(7 + a) * 16 + l];
                    assert!(
                        (got - k[a]).abs() < 1e-8,
                        "curvature_{} {got}, not {}",
                        a + 1,
                        k[a]
                    );
                    let moment = q.out.fields[(9 + a) * 16 + l];
                    assert!(
                        (moment - 0.005 * k[a]).abs() < 5e-11,
                        "bending_moment_{} {moment}",
                        a + 1
                    );
                }
            }
        }
    }
}

#[test]
fn picture_frame_of_one_flat_element_needs_the_measured_force_with_all_layers() {
    let m = fabric(&woven("fibre-energy")).unwrap();
    let s = Shell::new("{}", &m).unwrap();
    let square = [
        [0.0; 3],
        [SIZE, 0.0, 0.0],
        [SIZE, SIZE, 0.0],
        [0.0, SIZE, 0.0],
    ];
    let mut b = s.start(&[square; 8], [1.0, 0.0, 0.0]);
    for (degrees, want) in [(8.0f64, 1.78), (50.0, 8.33), (60.0, 23.4), (-50.0, -8.33)] {
        let g = degrees.to_radians();
        let d = [SIZE * g.sin(), SIZE * g.cos(), 0.0];
        let x = [[0.0; 3], square[1], [SIZE + d[0], d[1], 0.0], d];
        let f = s.forces(&mut b, &[x; 8], &[STILL; 8], 1e-6);
        let (dx, dy) = (SIZE * g.cos(), -SIZE * g.sin());
        let work: f64 = [2, 3]
            .iter()
            .map(|i| f.force[3 * i * 8] * dx + f.force[(3 * i + 1) * 8] * dy)
            .sum();
        let normalised = work / (SIZE * SIZE * g.cos());
        assert!(
            (normalised - want).abs() < 0.003 * f64::abs(want),
            "{degrees}: {normalised} N/m"
        );
        assert!((f.fields[0] - g).abs() < 1e-12);
        assert!(f.moment.iter().all(|v| v.abs() < 1e-15));
    }
}

#[test]
fn a_lane_does_not_depend_on_its_neighbours_nor_on_the_instruction_set() {
    let mut r = Random(107);
    let m = ply();
    let s = Shell::new("{}", &m).unwrap();
    let reference: Vec<Quad> = (0..64).map(|_| uneven(&mut r, 0.2, 0.05)).collect();
    let moves: Vec<(Vec<Quad>, Vec<Quad>)> = (0..3)
        .map(|_| {
            let x = reference
                .iter()
                .map(|q| deformed(&mut r, q, 0.2, 0.1))
                .collect();
            let w = (0..64)
                .map(|_| std::array::from_fn(|_| std::array::from_fn(|_| 0.5 * r.next())))
                .collect();
            (x, w)
        })
        .collect();
    let run = |start: usize, cut: usize| -> Out {
        let take =
            |v: &[Quad]| -> Vec<Quad> { v[start..start + cut].iter().rev().copied().collect() };
        let mut b = s.start(&take(&reference), AXIS);
        let mut f = None;
        for (x, w) in &moves {
            f = Some(s.forces(&mut b, &take(x), &take(w), 1.0));
        }
        f.unwrap()
    };
    let whole = run(0, 64);
    assert!(
        whole
            .force
            .iter()
            .chain(&whole.moment)
            .all(|v| v.is_finite())
    );
    for cut in [8, 16, 24] {
        for start in (0..=64 - cut).step_by(cut) {
            let part = run(start, cut);
            for (a, b) in [
                (&whole.force, &part.force),
                (&whole.moment, &part.moment),
                (&whole.energy, &part.energy),
                (&whole.fields, &part.fields),
                (&whole.step, &part.step),
            ] {
                for (row, part) in a.chunks(64).zip(b.chunks(cut)) {
                    for l in 0..cut {
                        let from = 63 - (start + cut - 1 - l);
                        assert_eq!(part[l].to_bits(), row[from].to_bits());
                    }
                }
            }
        }
    }
    for level in [Level::Portable, Level::Avx2] {
        limit_level(level);
        let same = run(0, 64);
        limit_level(Level::Avx512);
        assert_eq!(same, whole, "{level:?}");
    }
}

#[test]
fn stitch_of_a_twisted_element_fails_layer_by_layer() {
    // Sheared to the stitch's peak and twisted: the layer that is sheared more has failed further, so
    // after untwisting the layers' shear forces differ and a twisting moment stays.
    let m = ply();
    let s = Shell::new("{}", &m).unwrap();
    let square = [
        [0.0; 3],
        [SIZE, 0.0, 0.0],
        [SIZE, SIZE, 0.0],
        [0.0, SIZE, 0.0],
    ];
    let g = 0.5f64;
    let sheared = square.map(|[x, y, _]| [x + g.sin() * y, g.cos() * y, 0.0]);
    let mut b = s.start(&[square; 8], [1.0, 0.0, 0.0]);
    let flat = s.forces(&mut b, &[sheared; 8], &[STILL; 8], 1.0);
    assert!(flat.moment.iter().all(|v| v.abs() < 1e-15));
    // Directors turn by k12 = 200 1/m about x (k12 x), and back.
    let w = square.map(|[x, _, _]| [200.0 * (x - 0.5 * SIZE), 0.0, 0.0]);
    s.forces(&mut b, &[sheared; 8], &[w; 8], 1.0);
    let back = s.forces(&mut b, &[sheared; 8], &[w.map(|v| v.map(|c| -c)); 8], 1.0);
    let left = back.moment.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    assert!(left > 1e-7, "moment after untwisting {left} N m");
    // Another history than that of the middle alone.
    let one = Shell::new(r#"{"twist":"material"}"#, &m).unwrap();
    assert_eq!(one.sizes.material_points, 1);
    assert_eq!(s.sizes.material_points, 3);
}

#[test]
fn manifests_obey_the_models_rules_and_agree_with_the_code() {
    for (text, name) in manifest_names().iter().zip(["s4", "material-isotropic"]) {
        let manifest = Manifest::parse(text).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(manifest.name, name);
    }
    let json: serde_json::Value = serde_json::from_str(manifest_names()[0]).unwrap();
    let s = Shell::new("{}", &ply()).unwrap();
    assert_eq!(
        json["fields"].as_array().unwrap().len(),
        s.sizes.fields as usize
    );
    // The defaults written out give the same constants as none.
    let mut with = serde_json::Map::new();
    for (name, p) in json["parameters"].as_object().unwrap() {
        let value = match &p["default"] {
            serde_json::Value::String(t) if t == "3000 N/m" => serde_json::json!(3000.0),
            value => value.clone(),
        };
        if !value.is_null() {
            with.insert(name.clone(), value);
        }
    }
    let t = Shell::new(&serde_json::Value::Object(with).to_string(), &ply()).unwrap();
    let q = [[
        [0.0; 3],
        [SIZE, 0.0, 0.0],
        [SIZE, SIZE, 0.0],
        [0.0, SIZE, 0.0],
    ]; 8];
    assert_eq!(s.start(&q, AXIS).constants, t.start(&q, AXIS).constants);
    assert_eq!(s.sizes.history, t.sizes.history);
}

#[test]
fn what_cannot_work_is_refused_with_what_to_do() {
    const LAGGED: &str = r#"{"bending":"lagged-tangent"}"#;
    let no_bending = film(FILM).unwrap();
    let iso = plate(1e9, 0.3, 1e-3);
    let cases = [
        (&no_bending, "{}", "m4"),
        (&iso, LAGGED, "bending: total"),
        (&ply(), r#"{"core_share":1.0}"#, "core_share"),
        (&ply(), r#"{"transverse_shear":0}"#, "transverse_shear"),
        (&ply(), r#"{"hourglass_director":-1}"#, "hourglass_director"),
        (
            &ply(),
            r#"{"transverse_shear_modulus":0}"#,
            "transverse_shear_modulus",
        ),
        (&ply(), r#"{"twist":"none"}"#, "layers"),
        (&ply(), r#"{"thickening":3}"#, "0 to 2"),
        (
            &ply(),
            r#"{"thickening":2,"bending":"lagged-tangent"}"#,
            "bending: total",
        ),
    ];
    for (m, json, word) in cases {
        let text = Shell::new(json, m)
            .err()
            .unwrap_or_else(|| panic!("{json} was taken"));
        assert!(text.contains(word), "{json}: {text}");
    }
    // Without Poisson's ratio nothing couples.
    assert!(Shell::new(LAGGED, &plate(1e9, 0.0, 1e-3)).is_ok());
    // A host that gives no spins gets a status, not a crash.
    let s = Shell::new("{}", &ply()).unwrap();
    let q = [[
        [0.0; 3],
        [SIZE, 0.0, 0.0],
        [SIZE, SIZE, 0.0],
        [0.0, SIZE, 0.0],
    ]; 8];
    let mut b = s.start(&q, AXIS);
    assert_eq!(
        s.forces_without_spin(&mut b, &q),
        plyflow_sdk::abi::PF_BAD_SHAPE
    );
}
