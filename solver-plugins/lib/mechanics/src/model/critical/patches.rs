//! Random patches: meshes of 3 x 3 to 5 x 5 quads, each law and element with random sizes, and states that are strained, sheared beyond
//! locking, damaged, folded, curved or rough. The ranges were written before the first of them was measured.

use super::super::{Model, StepSettings};
use crate::MechanicsError;
use crate::component::{ElementInstance, MaterialInstance};
use crate::mesh::{QuadMesh, limit_patches};
use crate::sheet::{OtherMaterial, Pressed, SheetSpec};
use crate::vec3::Vec3;
use plyflow_abi::{PF_KIND_ELEMENT, PF_KIND_MATERIAL, pf_component};
use plyflow_kernels::built_in;
use std::sync::Arc;

/// A small deterministic generator.
pub(super) struct Random(u64);

impl Random {
    /// Generators of neighbouring seeds have nothing in common.
    pub(super) fn new(seed: u64) -> Self {
        let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Self(z ^ (z >> 31))
    }

    /// Uniform from 0 to 1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in its logarithm.
    fn scale(&mut self, low: f64, high: f64) -> f64 {
        (self.between(low.ln(), high.ln())).exp()
    }

    fn happens(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[((self.unit() * of.len() as f64) as usize).min(of.len() - 1)]
    }
}

/// A law with the numbers of a real material.
#[derive(Clone, Copy)]
pub(super) struct Law {
    /// As the record calls it.
    pub(super) name: &'static str,
    plugin: &'static str,
    parameters: &'static str,
    /// Largest strain along its axes that a patch is given.
    strain: f64,
}

/// A law whose families do not lie along the material's axes.
pub(super) const CROSSED: &str = "fabric, families at 60 deg";

/// Stitched fabric FCIM359, woven fabric 38616, film HT-350 (thesis tables 3.1, 3.2, 5.1), and plain sheets.
pub(super) const LAWS: [Law; 7] = [
    Law {
        name: "fabric, fibre-energy",
        plugin: "material-fabric",
        parameters: r#"{"form":"fibre-energy","fibre_modulus":3e9,"compression_factor":1.0,
            "shear":{"coefficients":[0,112.19,94.73,137.06,-65.56,29.56],"limit":1.0471975511965976},
            "stitch":{"angles":[0.06,0.5,0.75],"forces":[0,880,0]},
            "bending":{"positive":{"linear":1.9457e-4,"asymptote":0.03139,"scale":4.0},
                       "negative":{"linear":1.0279e-4,"asymptote":0.03619,"scale":6.5}},
            "thickness":4e-4,"areal_mass":0.44}"#,
        strain: 0.03,
    },
    Law {
        name: "fabric, hypoelastic",
        plugin: "material-fabric",
        parameters: r#"{"form":"hypoelastic","fibre_modulus":3e9,"compression_factor":1.0,
            "shear":{"coefficients":[0,112.19,94.73,137.06,-65.56,29.56],"limit":1.0471975511965976},
            "stitch":{"angles":[0.06,0.5,0.75],"forces":[0,880,0]},
            "bending":{"positive":{"linear":1.9457e-4,"asymptote":0.03139,"scale":4.0},
                       "negative":{"linear":1.0279e-4,"asymptote":0.03619,"scale":6.5}},
            "thickness":4e-4,"areal_mass":0.44}"#,
        strain: 0.03,
    },
    Law {
        name: "fabric, woven",
        plugin: "material-fabric",
        parameters: r#"{"form":"fibre-energy","fibre_modulus":3e9,"compression_factor":0.1,
            "shear":{"coefficients":[0,37.35,-322.61,1458.51,-3539.56,4727.84,-3275.20,930.53]},
            "bending":{"positive":{"linear":1.549e-5,"asymptote":0.00757,"scale":20.0}},
            "thickness":3e-4,"areal_mass":0.21}"#,
        strain: 0.03,
    },
    Law {
        name: CROSSED,
        plugin: "material-fabric",
        parameters: r#"{"fibre_modulus":3e9,"fibre_modulus_2":1e9,"compression_factor":0.3,"crossing":1.0471975511965976,
            "shear":{"coefficients":[0,112.19,94.73,137.06,-65.56,29.56],"limit":1.0471975511965976},
            "stitch":{"angles":[0.06,0.5,0.75],"forces":[0,880,0]},
            "bending":{"family_1":{"positive":{"linear":1.9457e-4,"asymptote":0.03139,"scale":4.0}},
                       "family_2":{"positive":{"linear":1.0279e-4,"asymptote":0.03619,"scale":6.5}}},
            "thickness":4e-4,"areal_mass":0.44}"#,
        strain: 0.03,
    },
    Law {
        name: "fabric-linear",
        plugin: "fabric-linear",
        parameters: r#"{"fibre_modulus_1":3e9,"fibre_modulus_2":1e9,"shear_modulus":1e6,
            "bending":{"family_1":2e-3,"family_2":1e-3,"twist":2e-4},"thickness":4e-4,"areal_mass":0.44}"#,
        strain: 0.03,
    },
    Law {
        name: "isotropic",
        plugin: "material-isotropic",
        parameters: r#"{"youngs_modulus":2e9,"poisson_ratio":0.3,"thickness":5e-4,"areal_mass":0.6}"#,
        strain: 0.1,
    },
    Law {
        name: "marlow",
        plugin: "material-marlow",
        parameters: r#"{"uniaxial":{"amplitude":6.364e6,"growth":0.4451,"decay":7.545},"limit":5.0,"thickness":8e-5,"areal_mass":0.08}"#,
        strain: 0.5,
    },
];

/// Components with their tables, made once: each call of [`built_in::component`] keeps one.
pub(super) struct Kit {
    element: pf_component,
    material: pf_component,
    law: Law,
    fibres_along_sides: bool,
    /// As its manifest calls it.
    pub(super) name: &'static str,
}

// SAFETY: function tables live as long as the program and are never written.
unsafe impl Sync for Kit {}

impl Kit {
    pub(super) fn new(element: &'static str, law: Law) -> Self {
        let of = |kind, name| built_in::component(kind, name).expect("a built-in component");
        Self {
            element: of(PF_KIND_ELEMENT, element),
            material: of(PF_KIND_MATERIAL, law.plugin),
            law,
            fibres_along_sides: element == "m4f" && law.name.starts_with("fabric"),
            name: element,
        }
    }

    /// The law's name.
    pub(super) fn law(&self) -> &'static str {
        self.law.name
    }

    fn material(
        &self,
        thickness: f64,
        areal_mass: f64,
    ) -> Result<Arc<MaterialInstance>, MechanicsError> {
        let mut json: serde_json::Value =
            serde_json::from_str(self.law.parameters).expect("JSON of a law");
        for (name, factor) in [("thickness", thickness), ("areal_mass", areal_mass)] {
            json[name] = (json[name].as_f64().expect("a number") * factor).into();
        }
        // SAFETY: the tables live as long as the program.
        unsafe { MaterialInstance::create(&self.material, &json.to_string(), "material") }
    }

    /// The element with default parameters but for these, of a material that is so many times as thick and heavy as the law's.
    pub(super) fn instance(
        &self,
        parameters: &serde_json::Value,
        [thickness, areal_mass]: [f64; 2],
    ) -> Result<ElementInstance, MechanicsError> {
        let material = self.material(thickness, areal_mass)?;
        let json = parameters.to_string();
        // SAFETY: as above.
        unsafe { ElementInstance::create(&self.element, &json, material, "element") }
    }
}

/// How far patches are from a good mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Range {
    /// As this module says.
    Wild,
    /// Of one material, with sides of 1 to 1.5, skewed by at most 10 degrees, nodes off by at most a twentieth; strained by at most 1 % and
    /// sheared by at most 45 degrees; folded, curved and rough as the others.
    Ordinary,
}

/// What is done to a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// As it was made.
    Rest,
    /// Strained along and between the material's axes.
    Strained,
    /// Sheared by up to 75 degrees, with fibres that keep their length but for small strains.
    Sheared,
    /// Sheared beyond the stitch's peak, and back by some part of the way.
    Damaged,
    /// Folded along a line by up to 180 degrees.
    Folded,
    /// Rolled up by up to 60 degrees per element.
    Curved,
    /// Nodes off the plane by up to a fifth of an edge.
    Rough,
}

const STATES: [State; 7] = [
    State::Rest,
    State::Strained,
    State::Sheared,
    State::Damaged,
    State::Folded,
    State::Curved,
    State::Rough,
];

/// Flat meshes of some thousandths to two hundredths of a metre per edge, sides up to ten times as long as others, skewed by up to 45
/// degrees, with nodes off their places by up to a fifth of a cell; and how many cells it has, along and across.
fn mesh(r: &mut Random, range: Range) -> QuadMesh {
    let counts = [0, 1].map(|_| r.one_of(&[3usize, 4, 5]));
    let edge = r.scale(1e-3, 2e-2);
    let [longest, leaning, most_off] = match range {
        Range::Wild => [10.0, 45.0, 0.2],
        Range::Ordinary => [1.5, 10.0, 0.05],
    };
    let stretched = if r.happens(0.5) {
        r.scale(1.0, longest)
    } else {
        1.0
    };
    let sides = if r.happens(0.5) {
        [edge * stretched, edge]
    } else {
        [edge, edge * stretched]
    };
    let skew = if r.happens(0.7) {
        r.between(-leaning, leaning)
    } else {
        0.0
    };
    let slope = f64::to_radians(skew).tan();
    let off = if r.happens(0.7) {
        r.between(0.0, most_off)
    } else {
        0.0
    };
    let lines = counts.map(|n| (0..=n).map(|i| i as f64).collect::<Vec<_>>());
    let mut mesh = QuadMesh::grid(&lines[0], &lines[1]);
    for p in &mut mesh.points {
        let [u, v] = [0, 1].map(|k| sides[k] * (p[k] + r.between(-off, off)));
        // Skewed by turning the second side, which keeps its length.
        let cosine = 1.0 / (1.0 + slope * slope).sqrt();
        *p = [u + slope * cosine * v, cosine * v, 0.0];
    }
    mesh
}

/// Turns `p` about a line through `at` along `axis` (of length 1).
fn turned(p: Vec3, at: Vec3, axis: Vec3, angle: f64) -> Vec3 {
    let d: Vec3 = std::array::from_fn(|k| p[k] - at[k]);
    let (s, c) = angle.sin_cos();
    let along = crate::vec3::dot(axis, d);
    let side = crate::vec3::cross(axis, d);
    std::array::from_fn(|k| at[k] + c * d[k] + s * side[k] + (1.0 - c) * along * axis[k])
}

/// A way of a patch from rest to a state.
pub(super) struct Way {
    pub(super) state: State,
    /// Direction of the first material axis (rad).
    direction: f64,
    strain: [f64; 2],
    /// Shear angle on the way and at its end (rad).
    shear: [f64; 2],
    /// A point (m) and direction (rad) of the line of a fold or of a cylinder.
    line: (Vec3, f64),
    /// Angle of the fold, or curvature of the cylinder (1/m).
    turn: f64,
    /// `[n]` how far nodes are off at the end (m).
    noise: Vec<Vec3>,
}

impl Way {
    fn new(r: &mut Random, mesh: &QuadMesh, direction: f64, strain: f64, range: Range) -> Self {
        let state = r.one_of(&STATES);
        let edge = shortest_edge(mesh);
        let most = if state == State::Rest {
            0.0
        } else {
            r.scale(1e-5, strain)
        };
        let mut strains = [0, 1].map(|_| r.between(-most, most));
        if strain > 0.1 && r.happens(0.5) {
            // Films are pulled, up to three times as long.
            strains = [0, 1].map(|_| r.between(0.0, 2.0 * most / strain));
        }
        let far = if range == Range::Wild { 75.0 } else { 45.0 };
        let degrees = match state {
            State::Sheared => [0.0, r.between(-far, far)],
            State::Damaged => {
                let far = r.between(5.0, 0.8 * far);
                [far, far * r.unit()]
            }
            State::Rest => [0.0; 2],
            _ => [0.0, r.between(-20.0, 20.0)],
        };
        let (turn, rough) = match state {
            State::Folded => (r.between(0.0, 180.0).to_radians(), 0.0),
            State::Curved => (r.between(-60.0, 60.0).to_radians() / edge, 0.0),
            State::Rough => (0.0, r.between(0.0, 0.2)),
            _ => (0.0, 0.0),
        };
        let at = r.one_of(&mesh.points);
        let line = (at, r.one_of(&[direction, direction + 0.5, 0.0, 1.0, 2.0]));
        let moved = |k: usize, r: &mut Random| {
            let by = if k == 2 { rough + most } else { most };
            edge * r.between(-by, by)
        };
        let noise = mesh.points.iter();
        Self {
            state,
            direction,
            strain: strains,
            shear: degrees.map(f64::to_radians),
            line,
            turn,
            noise: noise
                .map(|_| std::array::from_fn(|k| moved(k, r)))
                .collect(),
        }
    }

    /// Where the nodes are at the share `t` of the way.
    fn at(&self, points: &[Vec3], t: f64) -> Vec<Vec3> {
        // There and back, where it turns back.
        let [far, end] = self.shear;
        let angle = if far == 0.0 {
            t * end
        } else if t < 0.5 {
            2.0 * t * far
        } else {
            far + (2.0 * t - 1.0) * (end - far)
        };
        let (s, c) = self.direction.sin_cos();
        let [a, b] = self.strain.map(|e| 1.0 + t * e);
        let place = |(p, noise): (&Vec3, &Vec3)| -> Vec3 {
            let (u, v) = (c * p[0] + s * p[1], c * p[1] - s * p[0]);
            let (u, v) = (a * u + b * angle.sin() * v, b * angle.cos() * v);
            let flat = [c * u - s * v, s * u + c * v, 0.0];
            let bent = self.bent(flat, t);
            std::array::from_fn(|k| bent[k] + t * noise[k])
        };
        points.iter().zip(&self.noise).map(place).collect()
    }

    fn bent(&self, p: Vec3, t: f64) -> Vec3 {
        let (at, direction) = self.line;
        let (s, c) = direction.sin_cos();
        let away = -s * (p[0] - at[0]) + c * (p[1] - at[1]);
        match self.state {
            State::Folded if away > 0.0 => turned(p, at, [c, s, 0.0], t * self.turn),
            State::Curved if self.turn != 0.0 => {
                let k = t.max(1e-9) * self.turn;
                let (out, up) = ((k * away).sin() / k, (1.0 - (k * away).cos()) / k);
                let by = out - away;
                [p[0] - s * by, p[1] + c * by, p[2] + up]
            }
            _ => p,
        }
    }
}

fn shortest_edge(mesh: &QuadMesh) -> f64 {
    let edges = mesh
        .cells
        .iter()
        .flat_map(|c| (0..4).map(|e| [c[e], c[(e + 1) % 4]]));
    edges
        .map(|e| e.map(|n| mesh.points[n as usize]))
        .map(|[a, b]| crate::vec3::norm(crate::vec3::sub(a, b)))
        .fold(f64::INFINITY, f64::min)
}

/// A sheet of the mesh, with everything that the solver lets its cells differ in: material, added mass, layers.
fn sheet(kit: &Kit, r: &mut Random, mesh: &QuadMesh, direction: f64, range: Range) -> SheetSpec {
    let m = mesh.cells.len();
    let mut parameters = serde_json::json!({});
    if kit.fibres_along_sides {
        parameters["fibres_along_sides"] = true.into();
    }
    if kit.name != "m4f" && r.happens(0.25) {
        parameters["hourglass_floor"] = 0.0.into();
    }
    if ["rf4", "s4"].contains(&kit.name) && r.happens(0.25) {
        parameters["thickening"] = r.one_of(&[1, 2]).into();
    }
    if kit.name == "s4" && (r.happens(0.25) || kit.law.name == CROSSED) {
        parameters["twist"] = "material".into();
    }
    let sizes = [0, 1].map(|_| r.scale(0.3, 3.0));
    let element = kit.instance(&parameters, sizes).expect("an element");
    let mixed = range == Range::Wild;
    let other_material = (mixed && r.happens(0.3)).then(|| OtherMaterial {
        element: kit
            .instance(&parameters, sizes.map(|s| s * r.scale(0.5, 2.0)))
            .expect("another element"),
        elsewhere: None,
        cells: (0..m).map(|_| r.happens(0.5)).collect(),
    });
    let areal_mass = element.material.reference().sizes().areal_mass;
    let heavy = mixed && r.happens(0.15);
    let joined = mixed && kit.law.plugin == "material-marlow" && r.happens(0.3);
    let mut patches = mesh.patches();
    limit_patches(&mut patches, &mesh.points, element.sizes.patch_nodes);
    let mut weights = |there: bool, most: f64| -> Vec<f64> {
        let one = |r: &mut Random| if there && r.happens(0.5) { most } else { 1.0 };
        (0..m).map(|_| one(r)).collect()
    };
    SheetSpec {
        name: "patch".into(),
        nodes: (0..mesh.points.len() as u32).collect(),
        cells: mesh.cells.clone(),
        patches,
        axis: [direction.cos(), direction.sin(), 0.0],
        steered: None,
        layers: weights(joined, 2.0),
        pressed: vec![Pressed::No; m],
        least_areal_mass: weights(heavy, 3.0).iter().map(|w| w * areal_mass).collect(),
        element,
        elsewhere: None,
        other_material,
    }
}

/// The patch of a seed in its state, at the end of its way.
pub(super) fn patch(kit: &Kit, range: Range, seed: u64) -> Result<(Model, Way), MechanicsError> {
    let mut r = Random::new(seed);
    let mesh = mesh(&mut r, range);
    let along = kit.fibres_along_sides || r.happens(0.5);
    let direction = if along { 0.0 } else { r.between(-1.6, 1.6) };
    let strain = match range {
        Range::Wild => kit.law.strain,
        Range::Ordinary => 0.01,
    };
    let way = Way::new(&mut r, &mesh, direction, strain, range);
    // In some, mass is added for a step that is up to three times as long as the elements allow.
    let scaled = if range == Range::Wild && r.happens(0.25) {
        r.between(1.0, 3.0)
    } else {
        0.0
    };
    let mut settings = StepSettings {
        target_step: 0.0,
        safety: 1.0,
        damping: 0.0,
    };
    let state = r.0;
    let mut model = Model::new(
        mesh.points.clone(),
        vec![sheet(kit, &mut r, &mesh, direction, range)],
        settings,
    )?;
    if scaled > 0.0 {
        settings.target_step = scaled * model.critical_step()?;
        let again = sheet(kit, &mut Random(state), &mesh, direction, range);
        model = Model::new(mesh.points.clone(), vec![again], settings)?;
    }
    const STEPS: usize = 8;
    if way.state != State::Rest {
        for i in 1..=STEPS {
            let x = way.at(&mesh.points, i as f64 / STEPS as f64);
            model.lead(x, 1.0, &[])?;
        }
        lean(&mut model, &mut r)?;
    }
    Ok((model, way))
}

/// Turns the directors of nodes that rotate out of the normals, by up to a fifth of a right angle.
fn lean(model: &mut Model, r: &mut Random) -> Result<(), MechanicsError> {
    let Some(rotations) = model.state.rotations.as_deref_mut() else {
        return Ok(());
    };
    let most = r.scale(1e-4, 0.3);
    for spin in &mut rotations.spin {
        *spin = std::array::from_fn(|_| r.between(-most, most));
    }
    model.state.last_dt = 1.0;
    let done = model.internal_forces(false, false);
    model.state.last_dt = 0.0;
    if let Some(rotations) = model.state.rotations.as_deref_mut() {
        rotations.spin.fill([0.0; 3]);
    }
    done
}
