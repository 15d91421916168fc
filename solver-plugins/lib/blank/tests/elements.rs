//! Elements on meshes that follow an outline: a uniform strain is uniform, a parabola's curvature is that of the parabola.

use plyflow_blank::mesh_region;
use plyflow_geometry::vec3::{Vec3, norm};
use plyflow_kernels::{fabric::Fabric, m4::M4, rf4::Rf4};
use plyflow_mechanics::component::{ElementInstance, MaterialInstance};
use plyflow_mechanics::mesh::{QuadMesh, limit_patches};
use plyflow_mechanics::model::{Drive, Model, StepSettings};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_model::outline::{Point, Region};
use plyflow_sdk::abi::{PF_KIND_ELEMENT, PF_KIND_MATERIAL, pf_component, pf_str};
use plyflow_sdk::{Element, element_table, material_table};
use std::f64::consts::TAU;

const FABRIC: &str = r#"{"fibre_modulus":1e8,"shear":{"coefficients":[0,1000]},"thickness":1e-3,"areal_mass":1.0,
    "bending":{"positive":{"linear":1e-3},"negative":{"linear":1e-3}}}"#;

fn component<T>(kind: u32, table: T) -> pf_component {
    pf_component {
        kind,
        reserved: 0,
        // Lives as long as the process: a test.
        functions: (&raw const *Box::leak(Box::new(table))).cast(),
        manifest: pf_str::new("{}"),
    }
}

fn element<E: Element>() -> ElementInstance {
    // SAFETY: tables of the kinds that are said, which are never freed.
    unsafe {
        let material = component(PF_KIND_MATERIAL, material_table::<Fabric>());
        let material = MaterialInstance::create(&material, FABRIC, "material").unwrap();
        let element = component(PF_KIND_ELEMENT, element_table::<E>());
        ElementInstance::create(&element, "{}", material, "element").unwrap()
    }
}

struct Held(Vec<Vec3>);

impl Drive for Held {
    fn position(&self, k: usize, _: f64) -> Vec3 {
        self.0[k]
    }
}

/// A model of a mesh whose nodes are held where `to` puts them, after one step.
fn held<E: Element>(mesh: &QuadMesh, to: impl Fn(Vec3) -> Vec3) -> Model {
    let m = mesh.cells.len();
    let element = element::<E>();
    let mut patches = mesh.patches();
    limit_patches(&mut patches, &mesh.points, element.sizes.patch_nodes);
    let spec = SheetSpec {
        name: "ply".into(),
        nodes: (0..mesh.points.len() as u32).collect(),
        cells: mesh.cells.clone(),
        patches,
        axis: [1.0, 0.0, 0.0],
        steered: None,
        layers: vec![1.0; m],
        pressed: vec![Pressed::No; m],
        least_areal_mass: vec![0.0; m],
        element,
        elsewhere: None,
        other_material: None,
    };
    let settings = StepSettings {
        target_step: 0.0,
        safety: 0.8,
        damping: 0.0,
    };
    let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
    let places: Vec<Vec3> = mesh.points.iter().map(|x| to(*x)).collect();
    model.x_mut().copy_from_slice(&places.clone());
    model.set_step(1e-9);
    let nodes = (0..mesh.points.len() as u32).collect();
    model.set_driven(nodes, Box::new(Held(places)));
    model.step(true).unwrap();
    model
}

fn meshes() -> Vec<(&'static str, QuadMesh)> {
    let round = |x: Point, r: f64, n: usize| -> Vec<Point> {
        let turn = |k: usize| (TAU * k as f64 / n as f64).sin_cos();
        (0..n)
            .map(|k| [x[0] + r * turn(k).1, x[1] + r * turn(k).0])
            .collect()
    };
    let ring = Region::new(
        round([0.0; 2], 0.1, 360),
        vec![round([0.01, 0.02], 0.03, 360)],
    );
    let star: Vec<Point> = (0..10)
        .map(|k| round([0.0; 2], if k % 2 == 0 { 0.12 } else { 0.06 }, 10)[k])
        .collect();
    let mesh = |r: Region, size: f64| mesh_region(&r, size).unwrap();
    vec![
        ("ring", mesh(ring.unwrap(), 0.006)),
        (
            "star",
            mesh(Region::new(star.clone(), vec![]).unwrap(), 0.006),
        ),
        (
            "star with six cells at nodes",
            mesh(Region::new(star, vec![]).unwrap(), 0.015),
        ),
    ]
}

#[test]
fn a_uniform_strain_gives_uniform_fields_and_no_force_on_inner_nodes() {
    for (name, mesh) in meshes() {
        let model = held::<M4>(&mesh, |[x, y, _]| {
            [1.03 * x + 0.2 * y, 0.05 * x + 0.94 * y, 0.0]
        });
        for (row, what) in ["shear angle", "strain 1", "strain 2", "stretch"]
            .iter()
            .enumerate()
        {
            let field = model.cell_field(0, row);
            let first = field[0];
            assert!(first.abs() > 1e-3, "{name}: {what} {first}");
            for v in &field {
                assert!((v - first).abs() < 1e-12, "{name}: {what} {v} {first}");
            }
        }
        let boundary = mesh.on_boundary();
        let forces: Vec<f64> = model.reactions().iter().map(|f| norm(*f)).collect();
        let of = |edge: bool| {
            let some = forces.iter().zip(&boundary).filter(|f| *f.1 == edge);
            some.map(|f| *f.0).fold(0.0, f64::max)
        };
        assert!(of(true) > 1.0, "{name}: {}", of(true));
        assert!(
            of(false) < 1e-9 * of(true),
            "{name}: {} of {}",
            of(false),
            of(true)
        );
    }
}

#[test]
fn the_curvature_of_a_parabola_is_exact_at_every_inner_node() {
    for (name, mesh) in meshes() {
        let k = [3.0, -2.0];
        let z = |x: f64, y: f64| 0.5 * (k[0] * x * x + k[1] * y * y);
        let model = held::<Rf4>(&mesh, |[x, y, _]| [x, y, z(x, y)]);
        let curvature = [0, 1].map(|row| model.patch_field(0, row));
        let boundary = mesh.on_boundary();
        let mut inner = 0;
        for n in (0..mesh.points.len()).filter(|n| !boundary[*n]) {
            let [x, y, _] = mesh.points[n];
            let slopes = [k[0] * x, k[1] * y];
            let normal = (1.0 + slopes[0] * slopes[0] + slopes[1] * slopes[1]).sqrt();
            for a in 0..2 {
                let exact = k[a] / normal / (1.0 + slopes[a] * slopes[a]);
                let found = curvature[a][n];
                assert!(
                    (found / exact - 1.0).abs() < 1e-8,
                    "{name}: {found} {exact} at {x} {y}"
                );
            }
            inner += 1;
        }
        assert_eq!(model.patch_count(), inner, "{name}");
    }
}
