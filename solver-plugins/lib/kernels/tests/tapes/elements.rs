//! Elements with their materials in them.

use crate::common::*;
use crate::support::{BATCHES, Both, Buffers, LANES as WIDE, Random, compiled};
use plyflow_kernels::fabric::Fabric;
use plyflow_kernels::isotropic::Isotropic;
use plyflow_kernels::m4::M4;
use plyflow_kernels::m4f::M4f;
use plyflow_kernels::marlow::Marlow;
use plyflow_kernels::record;
use plyflow_kernels::rf4::{PATCH_NODES, Rf4};
use plyflow_kernels::s4::S4;
use plyflow_sdk::{
    Aligned, Constants, Element, ElementBatch, LocalMaterial, Material, PatchBatch, abi,
};
use plyflow_tape::Tape;

const PLATE: &str =
    r#"{"youngs_modulus":2e9,"poisson_ratio":0.3,"thickness":1e-3,"areal_mass":1.2}"#;
const DT: f64 = 3e-7;

/// A material as elements see it, and its tapes.
struct Under<M> {
    material: LocalMaterial<M>,
    membrane: Tape,
    bending: Option<Tape>,
}

impl<M: Material> Under<M> {
    fn new(json: &str) -> Self {
        let material = M::create(json).expect("a material");
        let membrane = record::membrane(&material, false).expect("a membrane");
        let bends = material.sizes().has_bending;
        let bending = bends.then(|| record::bending(&material).expect("a bending"));
        let material = LocalMaterial::new(material).expect("its sizes");
        Self {
            material,
            membrane,
            bending,
        }
    }

    fn inlined(&self, tape: &Tape) -> Tape {
        let of = |name: &str| match name {
            "membrane" => Some(&self.membrane),
            "bending" => self.bending.as_ref(),
            _ => None,
        };
        let whole = tape
            .with_calls(of)
            .unwrap_or_else(|fault| panic!("{fault}"));
        whole.check().unwrap_or_else(|fault| panic!("{fault}"));
        whole
    }
}

/// Nodes in a plane or near it, of an element or a patch, and the fabric's direction.
fn reference(random: &mut Random, nodes: &[[f64; 2]]) -> (Vec<[f64; 3]>, [f64; 3]) {
    let size = random.between(1e-3, 1e-2);
    let places = nodes.iter().map(|[u, v]| {
        [
            u + random.between(-0.2, 0.2),
            v + random.between(-0.2, 0.2),
            random.between(-0.02, 0.02),
        ]
        .map(|x| size * x)
    });
    let places = places.collect();
    let angle = random.between(-3.2, 3.2);
    (places, [angle.cos(), angle.sin(), 0.0])
}

/// What becomes of it: turned, stretched, sheared, bent, crumpled, or fallen together.
fn moved(random: &mut Random, reference: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let wild = random.chance(0.2);
    let spread = if wild { 1.0 } else { 0.05 };
    let mut f = [[0.0; 3]; 3];
    for (i, row) in f.iter_mut().enumerate() {
        for (j, x) in row.iter_mut().enumerate() {
            *x = f64::from(u8::from(i == j)) + random.between(-spread, spread);
        }
    }
    let size = reference
        .iter()
        .flatten()
        .fold(0.0f64, |m, x| m.max(x.abs()));
    let noise = if wild { 0.5 } else { 0.02 } * size;
    let fallen = random.chance(0.02);
    let still = random.chance(0.02);
    reference
        .iter()
        .map(|x| {
            if still {
                return *x;
            }
            let x = if fallen { [1e-9; 3] } else { *x };
            [0, 1, 2].map(|i| {
                let turned: f64 = (0..3).map(|j| f[i][j] * x[j]).sum();
                turned
                    + if fallen {
                        0.0
                    } else {
                        random.between(-noise, noise)
                    }
            })
        })
        .collect()
}

/// `[nodes][3][lanes]` of places by lane and node.
fn put(rows: &mut [f64], lane: usize, places: &[[f64; 3]]) {
    for (i, place) in places.iter().enumerate() {
        for (k, x) in place.iter().enumerate() {
            rows[(3 * i + k) * WIDE + lane] = *x;
        }
    }
}

const QUAD: [[f64; 2]; 4] = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];

/// Holds an element's forces, with their material in them, against what is recorded. So many choices go one way alone, or hardly the other, here: they
/// are the material's, and gone both ways in its own test, or cannot.
fn hold<E: Element, M: Material>(name: &str, element: &str, material: &str, seldom: usize) {
    let under = Under::<M>::new(material);
    let seen = under.material.seen();
    let element = E::create(element, seen).unwrap_or_else(|why| panic!("{name}: {why}"));
    let tape = record::forces(&element, seen.sizes()).unwrap_or_else(|why| panic!("{name}: {why}"));
    let tape = under.inlined(&tape);
    let compiled = compiled(&[("element", &tape)]);
    let mut both = Both::new(&tape, &compiled, "element");
    let (sizes, mut random) = (element.sizes(), Random::new(11));
    let (turns, points) = (
        sizes.dofs_per_node == 6,
        sizes.material_points * seen.sizes().membrane_history,
    );
    let mut constants = Aligned::zeros(sizes.constants * WIDE);
    let mut rest = vec![Vec::new(); WIDE];
    let mut history = Aligned::zeros(sizes.history * WIDE);
    let mut material_history = Aligned::zeros(points * WIDE);
    for batch in 0..BATCHES {
        if batch % 20 == 0 {
            let (mut position, mut axis) = (Aligned::zeros(12 * WIDE), Aligned::zeros(3 * WIDE));
            for (lane, rest) in rest.iter_mut().enumerate() {
                let (places, along) = reference(&mut random, &QUAD);
                put(&mut position, lane, &places);
                put(&mut axis, lane, &[along]);
                *rest = places;
            }
            let (mut mass, mut inertia) = (Aligned::zeros(4 * WIDE), Aligned::zeros(4 * WIDE));
            element.initialise(
                &mut ElementBatch {
                    lanes: WIDE,
                    dt: 0.0,
                    position: &position,
                    velocity: &[],
                    spin: &[],
                    axis: &axis,
                    constants: Constants::Open(&mut constants),
                    history: &mut [],
                    material_history: &mut [],
                    force: &mut [],
                    moment: &mut [],
                    energy: &mut [],
                    fields: None,
                    mass: &mut mass,
                    inertia: if turns { &mut inertia } else { &mut [] },
                    critical_step: None,
                },
                seen,
            );
            history.fill(0.0);
            material_history.fill(0.0);
        }
        let mut before = Buffers::new(&tape);
        for (lane, rest) in rest.iter().enumerate() {
            put(before.get_mut("position"), lane, &moved(&mut random, rest));
        }
        if turns {
            // Most turn by little in a step, some by many turns.
            for x in before.get_mut("spin") {
                let fast = random.chance(0.1);
                *x = random.sized(1.0, if fast { 1e8 } else { 1e4 });
            }
        }
        before.get_mut("constants").copy_from_slice(&constants);
        before.get_mut("history").copy_from_slice(&history);
        before
            .get_mut("material_history")
            .copy_from_slice(&material_history);
        before.get_mut("dt")[0] = DT;
        let turning = if turns { 12 * WIDE } else { 0 };
        let (mut force, mut moment) = (Aligned::zeros(12 * WIDE), Aligned::zeros(turning));
        let mut energy = Aligned::zeros(3 * WIDE);
        let code = element.forces(
            &mut ElementBatch {
                lanes: WIDE,
                dt: DT,
                position: before.get("position"),
                velocity: &[],
                spin: if turns { before.get("spin") } else { &[] },
                axis: &[],
                constants: Constants::Fixed(&constants),
                history: &mut history,
                material_history: &mut material_history,
                force: &mut force,
                moment: &mut moment,
                energy: &mut energy,
                fields: None,
                mass: &mut [],
                inertia: &mut [],
                critical_step: None,
            },
            seen,
        );
        assert_eq!(code, abi::PF_OK, "{name}");
        let mut wanted: Vec<(&str, &[f64])> = vec![
            ("force", &force),
            ("energy", &energy),
            ("history", &history),
            ("material_history", &material_history),
        ];
        if turns {
            wanted.push(("moment", &moment));
        }
        both.hold(&before, &wanted);
    }
    both.all_taken(1000, seldom);
    println!("{name}: {:?}", tape.counts());
}

#[test]
fn membranes_of_one_point_give_their_bits() {
    hold::<M4, Fabric>("m4, NCF", "{}", &ncf("fibre-energy", ""), 1);
    hold::<M4, Fabric>("m4, hypoelastic", "{}", &ncf("hypoelastic", ""), 0);
    hold::<M4, Marlow>("m4, film", "{}", FILM, 1);
    hold::<M4, Isotropic>("m4, plate", r#"{"hourglass_normal": 0.5}"#, PLATE, 0);
}

#[test]
fn membranes_of_four_points_give_their_bits() {
    hold::<M4f, Marlow>("m4f, film", "{}", FILM, 4);
    hold::<M4f, Fabric>(
        "m4f, woven",
        r#"{"fibres_along_sides": true}"#,
        &woven("fibre-energy"),
        0,
    );
}

#[test]
fn shells_with_rotations_give_their_bits() {
    hold::<S4, Fabric>("s4, NCF in three layers", "{}", &ncf("fibre-energy", ""), 3);
    hold::<S4, Fabric>(
        "s4, lagged tangent",
        r#"{"bending": "lagged-tangent"}"#,
        &ncf("hypoelastic", ""),
        0,
    );
    hold::<S4, Isotropic>(
        "s4, plate that thickens",
        r#"{"twist": "material", "thickening": 2}"#,
        PLATE,
        0,
    );
}

/// Places around a node: a ring of four or eight neighbours, and more.
fn patch(nodes: usize) -> Vec<[f64; 2]> {
    let mut places = vec![[0.0, 0.0]];
    places.extend((1..nodes).map(|i| {
        let turn = std::f64::consts::TAU * i as f64 / (nodes - 1) as f64;
        let far = if i % 2 == 0 { 1.3 } else { 1.0 };
        [far * turn.cos(), far * turn.sin()]
    }));
    places
}

/// Holds a patch's forces against what is recorded for its number of nodes.
fn hold_patch<M: Material>(name: &str, element: &str, material: &str, nodes: usize) {
    let under = Under::<M>::new(material);
    let seen = under.material.seen();
    let element = Rf4::create(element, seen).unwrap_or_else(|why| panic!("{name}: {why}"));
    let tape = record::patch_forces(&element, seen.sizes(), nodes);
    let tape = under.inlined(&tape.unwrap_or_else(|why| panic!("{name}: {why}")));
    let compiled = compiled(&[("patch", &tape)]);
    let mut both = Both::new(&tape, &compiled, "patch");
    let (sizes, mut random) = (element.sizes(), Random::new(12));
    let mut constants = Aligned::zeros(sizes.patch_constants * WIDE);
    let mut rest = vec![Vec::new(); WIDE];
    let mut history = Aligned::zeros(seen.sizes().bending_history * WIDE);
    for batch in 0..BATCHES {
        if batch % 20 == 0 {
            let mut position = Aligned::zeros(3 * PATCH_NODES * WIDE);
            let (mut axis, mut area, mut count) = (
                Aligned::zeros(3 * WIDE),
                Aligned::zeros(WIDE),
                Aligned::zeros(WIDE),
            );
            for (lane, rest) in rest.iter_mut().enumerate() {
                let (places, along) = reference(&mut random, &patch(nodes));
                put(&mut position, lane, &places);
                put(&mut axis, lane, &[along]);
                *rest = places;
            }
            area.fill(1e-5);
            count.fill(nodes as f64);
            element.patch_initialise(
                &mut PatchBatch {
                    lanes: WIDE,
                    dt: 0.0,
                    position: &position,
                    count: &count,
                    area: &area,
                    axis: &axis,
                    constants: Constants::Open(&mut constants),
                    history: &mut [],
                    force: &mut [],
                    energy: &mut [],
                    fields: None,
                    stiffness: None,
                },
                seen,
            );
            history.fill(0.0);
        }
        let mut before = Buffers::new(&tape);
        for (lane, rest) in rest.iter().enumerate() {
            put(before.get_mut("position"), lane, &moved(&mut random, rest));
        }
        before.get_mut("constants").copy_from_slice(&constants);
        before.get_mut("history").copy_from_slice(&history);
        before.get_mut("dt")[0] = DT;
        let (mut force, mut energy) =
            (Aligned::zeros(3 * PATCH_NODES * WIDE), Aligned::zeros(WIDE));
        let code = element.patch_forces(
            &mut PatchBatch {
                lanes: WIDE,
                dt: DT,
                position: before.get("position"),
                count: &[],
                area: &[],
                axis: &[],
                constants: Constants::Fixed(&constants),
                history: &mut history,
                force: &mut force,
                energy: &mut energy,
                fields: None,
                stiffness: None,
            },
            seen,
        );
        assert_eq!(code, abi::PF_OK, "{name}");
        both.hold(
            &before,
            &[
                ("force", &force),
                ("energy", &energy),
                ("history", &history),
            ],
        );
    }
    both.all_taken(1000, 0);
    println!("{name}: {:?}", tape.counts());
}

#[test]
fn patches_of_every_number_of_nodes_give_their_bits() {
    for nodes in [4, 5, 7, 9, PATCH_NODES] {
        hold_patch::<Fabric>(
            &format!("rf4, NCF, {nodes} nodes"),
            "{}",
            &ncf("fibre-energy", ""),
            nodes,
        );
    }
    hold_patch::<Fabric>(
        "rf4 that thickens",
        r#"{"thickening": 2}"#,
        &ncf("fibre-energy", ""),
        9,
    );
    hold_patch::<Isotropic>("rf4, plate", r#"{"thickening": 1}"#, PLATE, 9);
}
