//! Surfaces that unroll shear nothing; fibres keep their length on every surface.

use plyflow_forming_kinematic::drop_on;
use plyflow_forming_kinematic::net::{Fabric, Generators, Net, Node};
use plyflow_forming_kinematic::surface::{DrapeSurface, SmoothSurface};
use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_model::scene::{FlatTool, Tool};
use plyflow_model::units::Length;
use plyflow_tooling::ToolMesh;
use std::convert::Infallible;
use std::f64::consts::{FRAC_PI_2, PI};

fn fabric(turn: f64, spacing: f64, offset: f64) -> Fabric {
    Fabric {
        directions: [turn, turn + FRAC_PI_2],
        blank: [-0.060, -0.045, 0.060, 0.045],
        start: [0.0; 2],
        spacing,
        locking: 80f64.to_radians(),
        bed: 0.0,
        generators: Generators::Geodesic,
        offset,
    }
}

fn drape(mesh: &ToolMesh, fabric: Fabric) -> Net {
    let surface = SmoothSurface::new(mesh, 0.5).expect("facets");
    let [x, y] = fabric.start;
    let (z, face) = surface.top(x, y).expect("a tool below the start");
    let (place, normal) = drop_on(&surface, [x, y, z], face, fabric.offset, 0.05).expect("a start");
    let mut net = Net::new(fabric).expect("a small net");
    let Ok(()) = net.drape(&surface, place, normal, |_| Ok::<(), Infallible>(()));
    net
}

/// Largest strain of a fibre, largest shear (rad) by size, share of the net's nodes that are placed.
fn measured(net: &Net) -> (f64, f64, f64) {
    let (mut strain, mut shear) = (0.0f64, 0.0f64);
    let (mut used, mut placed) = (0.0, 0.0);
    for (at, node) in net.nodes() {
        used += f64::from(u8::from(node != Node::Unused));
        placed += f64::from(u8::from(net.position(at).is_some()));
        if let Some(g) = net.shear(at) {
            shear = shear.max(g.abs());
            let x = plyflow_forming_kinematic::net::corners(at).map(|c| net.position(c).unwrap());
            for k in 0..4 {
                let side = distance(x[k], x[(k + 1) % 4]);
                strain = strain.max((side / net.fabric.spacing - 1.0).abs());
            }
        }
    }
    (strain, shear, placed / used)
}

/// A sheet z(x, y) = height(x) as facets, `n` along x and 9 along y.
fn ruled(n: usize, at: impl Fn(f64) -> [f64; 2]) -> ToolMesh {
    let mut mesh = ToolMesh::default();
    for i in 0..=n {
        let [x, z] = at(i as f64 / n as f64);
        for j in 0..=9 {
            mesh.points.push([x, 0.24 * (f64::from(j) / 9.0 - 0.5), z]);
        }
    }
    for i in 0..n as u32 {
        for j in 0..9 {
            let (a, b) = (10 * i + j, 10 * (i + 1) + j);
            mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
    }
    mesh
}

/// The upper half of a cylinder of radius 50 mm along y.
fn cylinder(n: usize) -> ToolMesh {
    ruled(n, |s| {
        let angle = PI * (s - 0.5);
        [0.05 * angle.sin(), 0.2 + 0.05 * angle.cos()]
    })
}

#[test]
fn flat_tool_shears_nothing_whatever_the_fibres() {
    let tool = Tool::Flat(FlatTool {
        length: Length(0.3),
        width: Length(0.25),
        height: Length(0.02),
        fillet: Length(0.005),
        facet_size: Length(0.012),
    });
    let mesh = plyflow_tooling::build(&tool).expect("a block");
    for turn in [0.0f64, -45.0, 17.0] {
        let net = drape(&mesh, fabric(turn.to_radians(), 2.3e-3, 0.7e-3));
        let (strain, shear, placed) = measured(&net);
        assert_eq!(placed, 1.0);
        assert!(
            shear < 1e-12 && strain < 1e-12,
            "{turn} deg: {shear} {strain}"
        );
        for (at, _) in net.nodes() {
            let Some(x) = net.position(at) else { continue };
            let [u, v] = net.flat(at);
            assert!(distance(x, [u, v, 0.0207]) < 1e-12, "{x:?} {u} {v}");
        }
    }
}

#[test]
fn cylinder_with_a_family_along_it_shears_nothing() {
    for turn in [0.0, FRAC_PI_2] {
        let net = drape(&cylinder(60), fabric(turn, 2e-3, 0.5e-3));
        let (strain, shear, placed) = measured(&net);
        assert_eq!(placed, 1.0);
        assert!(shear < 1e-9 && strain < 1e-12, "{shear} {strain}");
    }
}

#[test]
fn cylinder_with_slanted_fibres_shears_nothing() {
    for spacing in [4e-3, 1e-3] {
        let net = drape(&cylinder(60), fabric(0.6, spacing, 0.5e-3));
        let (strain, shear, placed) = measured(&net);
        println!("spacing {spacing}: shear {shear} rad");
        assert_eq!(placed, 1.0);
        assert!(shear < 1e-6 && strain < 1e-12, "{shear} {strain}");
    }
}

/// A cone about z with its tip at 0.3 m, falling at 35 degrees.
struct Cone;

impl DrapeSurface for Cone {
    fn level(&self, p: Vec3, offset: f64) -> Option<(f64, Vec3)> {
        let (s, c) = 35f64.to_radians().sin_cos();
        let r = p[0].hypot(p[1]);
        let normal = [s * p[0] / r, s * p[1] / r, c];
        Some((s * r + c * (p[2] - 0.3) - offset, normal))
    }
}

#[test]
fn cone_beside_its_tip_shears_nothing_as_the_spacing_falls_and_strains_no_fibre() {
    // From a place where the whole net stays on one side of the tip.
    let mut before = f64::INFINITY;
    for spacing in [4e-3, 2e-3, 1e-3] {
        let mut f = fabric(0.3, spacing, 0.2e-3);
        f.start = [0.12, 0.0];
        f.blank = [0.06, -0.045, 0.18, 0.045];
        let (s, c) = 35f64.to_radians().sin_cos();
        let place = [0.12, 0.0, 0.3 + (f.offset - s * 0.12) / c];
        let mut net = Net::new(f).unwrap();
        let Ok(()) = net.drape(&Cone, place, [s, 0.0, c], |_| Ok::<(), Infallible>(()));
        let (strain, shear, placed) = measured(&net);
        println!("{spacing}: shear {shear}, strain {strain}");
        assert_eq!(placed, 1.0);
        assert!(strain < 1e-9, "{strain}");
        assert!(shear < before / 3.0, "{shear} {before}");
        before = shear;
    }
    assert!(before < 1e-4, "{before}");
}

#[test]
fn ramp_with_fillets_keeps_every_fibre_and_unrolls() {
    // Level, arc of 30 mm radius down by 40 degrees, slope, arc back, level: C1, curvature jumps.
    let turn = 40f64.to_radians();
    let profile = |s: f64| {
        let (arc, straight) = (0.03 * turn, 0.03);
        let length = 0.12 + 2.0 * arc + straight;
        let mut left = s * length;
        let mut x = [-0.11, 0.2];
        for (piece, bend, from) in [
            (0.06, 0.0, 0.0),
            (arc, -1.0, 0.0),
            (straight, 0.0, -turn),
            (arc, 1.0, -turn),
            (0.06, 0.0, 0.0),
        ] {
            let go = f64::min(left, piece);
            if bend == 0.0 {
                x = [x[0] + go * f64::cos(from), x[1] + go * f64::sin(from)];
            } else {
                let to = from + bend * go / 0.03;
                x[0] += 0.03 * bend * (to.sin() - from.sin());
                x[1] -= 0.03 * bend * (to.cos() - from.cos());
            }
            left -= go;
        }
        x
    };
    for (turn, bound) in [(0.0, 1e-5), (0.7, 2e-3)] {
        let net = drape(&ruled(120, profile), fabric(turn, 1.5e-3, 0.4e-3));
        let (strain, shear, placed) = measured(&net);
        println!("turn {turn}: shear {shear}, strain {strain}");
        assert_eq!(placed, 1.0);
        assert!(strain < 1e-9 && shear < bound, "{turn}: {strain} {shear}");
    }
}

#[test]
fn fibres_at_other_than_right_angles_start_unsheared() {
    let mut f = fabric(-0.5, 2e-3, 0.5e-3);
    f.directions[1] = 0.5;
    let net = drape(&ruled(40, |s| [0.3 * (s - 0.5), 0.1]), f);
    let (strain, shear, placed) = measured(&net);
    assert_eq!(placed, 1.0);
    assert!(shear < 1e-12 && strain < 1e-12, "{shear} {strain}");
}

#[test]
fn projected_generators_are_geodesics_on_a_sphere_and_differ_on_a_slanted_slope() {
    let slope = |direction: f64, generators| {
        // A plane falling at 30 degrees along x: both nets are unsheared only when both generators keep
        // their angle, which projections do not.
        let mut f = fabric(direction, 2e-3, 0.0);
        f.generators = generators;
        let net = drape(
            &ruled(20, |s| {
                [
                    0.4 * (s - 0.5),
                    0.3 - 0.4 * (s - 0.5) * 30f64.to_radians().tan(),
                ]
            }),
            f,
        );
        measured(&net)
    };
    let (_, straight, _) = slope(0.5, Generators::Geodesic);
    let (strain, projected, _) = slope(0.5, Generators::Projection);
    // In the plane the directions (cos a, sin a) and (-sin a, cos a) stretch along x by 1 / cos 30 degrees.
    let k = 1.0 / 30f64.to_radians().cos();
    let (s, c) = 0.5f64.sin_cos();
    let cosine = (-k * k * s * c + s * c) / ((k * c).hypot(s) * (k * s).hypot(c));
    assert!(straight < 1e-12, "{straight}");
    assert!(
        (projected - cosine.asin().abs()).abs() < 1e-9,
        "{projected} {cosine}"
    );
    assert!(strain < 1e-12);
}
