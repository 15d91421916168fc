use super::*;
use crate::build;
use crate::chord::CHORD_TOLERANCE;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, scale, sub, unit};
use plyflow_model::scene::{FlatTool, JoggleSpar, RampedSpar, Scene, Tool};
use plyflow_model::units::{Angle, Length};

const MM: f64 = 1e-3;

fn mm(v: f64) -> Length {
    Length(v * MM)
}

/// The spar of `workflows/joggle-spar`.
pub(crate) fn demo() -> JoggleSpar {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../workflows/joggle-spar/scene.yaml"
    );
    let text = std::fs::read_to_string(path).unwrap();
    let scene = Scene::from_json(serde_saphyr::from_str(&text).unwrap()).unwrap();
    match scene.tool {
        Tool::JoggleSpar(spar) => spar,
        other => panic!("not a joggle spar: {other:?}"),
    }
}

/// Principal curvatures at the middle of a 3 x 3 patch of a regular map.
fn curvatures(patch: &dyn Fn(f64, f64) -> Vec3, u: f64, v: f64, d: f64) -> [f64; 2] {
    let at = |i: f64, j: f64| patch(u + i * d, v + j * d);
    let half = |a: Vec3, b: Vec3| scale(sub(a, b), 0.5 / d);
    let pu = half(at(1.0, 0.0), at(-1.0, 0.0));
    let pv = half(at(0.0, 1.0), at(0.0, -1.0));
    let second = |a: Vec3, b: Vec3, c: Vec3| scale(add(sub(a, b), sub(c, b)), 1.0 / (d * d));
    let puu = second(at(1.0, 0.0), at(0.0, 0.0), at(-1.0, 0.0));
    let pvv = second(at(0.0, 1.0), at(0.0, 0.0), at(0.0, -1.0));
    let puv = scale(
        sub(
            sub(at(1.0, 1.0), at(1.0, -1.0)),
            sub(at(-1.0, 1.0), at(-1.0, -1.0)),
        ),
        0.25 / (d * d),
    );
    let n = unit(cross(pu, pv));
    let (e, f, g) = (dot(pu, pu), dot(pu, pv), dot(pv, pv));
    let (l, m, nn) = (dot(puu, n), dot(puv, n), dot(pvv, n));
    let area = e * g - f * f;
    let mean = (e * nn - 2.0 * f * m + g * l) / (2.0 * area);
    let gauss = (l * nn - m * m) / area;
    let root = (mean * mean - gauss).max(0.0).sqrt();
    [mean - root, mean + root]
}

/// Smallest radius of curvature over top, fillets and walls (m).
fn smallest_radius(s: &SparShape) -> f64 {
    let ([low, high], half, radius) = s.top();
    let mut largest: f64 = 0.0;
    let mut look = |patch: &dyn Fn(f64, f64) -> Vec3, u: f64, v: f64| {
        for k in curvatures(patch, u, v, 2e-5) {
            largest = largest.max(k.abs());
        }
    };
    let top = |x: f64, y: f64| s.deform([x, y, s.height]);
    for i in 1..400 {
        for j in 1..60 {
            let x = low + (high - low) * i as f64 / 400.0;
            let y = half * (2.0 * j as f64 / 60.0 - 1.0);
            look(&top, x, y);
        }
    }
    let arc = s.arc_angle();
    let profile = |v: f64| {
        if v < arc * s.fillet {
            s.fillet_point(v / s.fillet)
        } else {
            s.wall_point(v - arc * s.fillet)
        }
    };
    for side in [-1.0, 1.0] {
        let straight = |x: f64, v: f64| s.surface([x, side * half], [0.0, side], profile(v));
        for i in 1..600 {
            for j in 1..80 {
                let x = low + radius + (high - low - 2.0 * radius) * i as f64 / 600.0;
                look(&straight, x, 0.1 * j as f64 / 80.0);
            }
        }
        for (end, outward) in [(low, -1.0), (high, 1.0)] {
            let corner = |u: f64, v: f64| {
                let angle = u / s.corner;
                let n = [outward * angle.cos(), side * angle.sin()];
                let centre = [end - outward * radius, side * (half - radius)];
                let base = [centre[0] + radius * n[0], centre[1] + radius * n[1]];
                s.surface(base, n, profile(v))
            };
            for i in 1..20 {
                for j in 1..80 {
                    let u = s.corner * std::f64::consts::FRAC_PI_2 * i as f64 / 20.0;
                    look(&corner, u, 0.1 * j as f64 / 80.0);
                }
            }
        }
    }
    1.0 / largest
}

#[test]
fn no_radius_is_smaller_than_the_10_mm_of_the_thesis() {
    let found = smallest_radius(&demo().shape().unwrap());
    println!("smallest radius {:.2} mm", found / MM);
    assert!(found >= 10.0 * MM, "found {:.3} mm", found / MM);
}

#[test]
fn straight_ramps_without_steps_are_nearly_as_blunt_as_the_stated_fillets() {
    let mut spar = demo();
    for j in &mut spar.joggles {
        j.skew = Angle(0.0);
        j.side_step = [mm(0.0); 2];
    }
    let found = smallest_radius(&spar.shape().unwrap()) / MM;
    assert!(
        found > 0.93 * 14.0 && found < 1.01 * 14.0,
        "stated 14 mm; found {found:.3} mm"
    );
}

#[test]
fn curvature_measure_sees_a_sharper_fillet() {
    let mut sweep = demo().shape().unwrap();
    sweep.fillet = 6.0 * MM;
    let found = smallest_radius(&sweep);
    assert!(found < 6.1 * MM, "found {:.3} mm", found / MM);
}

#[test]
fn top_rises_by_each_joggle_and_walls_step_outwards() {
    let sweep = demo().shape().unwrap();
    let z = |x: f64, y: f64| sweep.deform([x * MM, y * MM, sweep.height])[2] / MM;
    for y in [-50.0, 0.0, 50.0] {
        assert!((z(-200.0, y) - 110.0).abs() < 1e-9);
        assert!((z(0.0, y) - 120.0).abs() < 1e-9);
        assert!((z(200.0, y) - 110.0).abs() < 1e-9);
    }
    // The ramp starts later at y > 0: asymmetric about the width.
    assert!(z(-100.0, -50.0) > z(-100.0, 50.0) + 4.0);
    let wall = |x: f64, side: f64| {
        let half = sweep.top().1;
        let p = sweep.surface([x * MM, side * half], [0.0, side], sweep.wall_point(0.03));
        side * p[1] / MM
    };
    assert!((wall(0.0, -1.0) - wall(-200.0, -1.0) - 6.0).abs() < 1e-9);
    assert!((wall(0.0, 1.0) - wall(-200.0, 1.0)).abs() < 1e-9);
    assert!((wall(200.0, 1.0) - wall(0.0, 1.0) - 6.0).abs() < 1e-9);
}

#[test]
fn spar_is_closed_stands_on_the_bed_and_has_the_stated_length() {
    let spar = demo();
    let mesh = build(&Tool::JoggleSpar(spar.clone())).unwrap();
    println!(
        "{} points, {} facets",
        mesh.points.len(),
        mesh.triangles.len()
    );
    assert!(mesh.is_watertight());
    let [lo, hi] = mesh.bounds();
    assert!(
        lo[2].abs() < 1e-12 && (hi[2] - 0.120).abs() < 1e-9,
        "{lo:?} {hi:?}"
    );
    assert!(
        (lo[0] + 0.310).abs() < 1e-6 && (hi[0] - 0.310).abs() < 1e-6,
        "{lo:?} {hi:?}"
    );
    assert!(
        mesh.longest_edge() <= spar.facet_size.si(),
        "{}",
        mesh.longest_edge()
    );
    // Between the boxes of the narrowest and the widest section.
    let volume = mesh.volume();
    assert!(
        volume > 0.55 * 0.130 * 0.110 && volume < 0.62 * 0.176 * 0.120,
        "{volume}"
    );
    let up = (0..mesh.triangles.len()).all(|t| {
        let top = mesh.corners(t).iter().all(|p| p[2] > 0.02);
        !top || mesh.area_normal(t)[2] > 0.0
    });
    assert!(up, "a facet above the bed looks down");
}

#[test]
fn facets_follow_the_curved_surface_within_the_chord_tolerance() {
    let coarse = build(&Tool::JoggleSpar(demo())).unwrap();
    let fine = JoggleSpar {
        facet_size: mm(1.5),
        ..demo()
    };
    let tree = crate::SurfaceTree::new(&build(&Tool::JoggleSpar(fine)).unwrap());
    let largest = (0..coarse.triangles.len())
        .step_by(7)
        .map(|t| {
            let [a, b, c] = coarse.corners(t);
            tree.closest(scale(add(add(a, b), c), 1.0 / 3.0))
                .signed_distance
                .abs()
        })
        .fold(0.0, f64::max);
    println!(
        "largest distance of a facet's centre {:.4} mm",
        largest / MM
    );
    assert!(largest < 2.0 * CHORD_TOLERANCE, "{:.4} mm", largest / MM);
}

#[test]
fn flat_block_has_the_closed_form_volume() {
    let block = FlatTool {
        length: mm(300.0),
        width: mm(200.0),
        height: mm(20.0),
        fillet: mm(8.0),
        facet_size: mm(4.0),
    };
    let mesh = build(&Tool::Flat(block)).unwrap();
    assert!(mesh.is_watertight());
    assert!(mesh.longest_edge() <= 0.004);
    let (r, c, pi) = (8.0, 16.0, std::f64::consts::PI);
    // Prism with rounded vertical edges, less the fillet's cut-off swept around (Pappus on the arcs).
    let prism = (300.0 * 200.0 - (4.0 - pi) * c * c) * 20.0;
    let cut = r * r * (1.0 - pi / 4.0);
    let centroid = r * (10.0 - 3.0 * pi) / (12.0 - 3.0 * pi);
    let straight = 2.0 * (300.0 - 2.0 * c) + 2.0 * (200.0 - 2.0 * c);
    let exact = prism - cut * (straight + 2.0 * pi * (c - centroid));
    let found = mesh.volume() * 1e9;
    // Chords cut at most 2/3 of the tolerance, on average, from the rounded faces.
    let rounded = 1e3 * CHORD_TOLERANCE * (straight + 2.0 * pi * c) * (pi * r / 2.0 + 20.0);
    assert!(
        found < exact && found > exact - rounded,
        "{found} against {exact}, chords {rounded}"
    );
    let [lo, hi] = mesh.bounds();
    assert!(
        (hi[0] - 0.15).abs() < 1e-9 && (lo[1] + 0.1).abs() < 1e-9 && (hi[2] - 0.02).abs() < 1e-12
    );
}

#[test]
fn impossible_parameters_are_errors_that_name_the_parameter_and_its_bound() {
    let text = |change: &dyn Fn(&mut JoggleSpar)| {
        let mut spar = demo();
        change(&mut spar);
        build(&Tool::JoggleSpar(spar)).unwrap_err().to_string()
    };
    let check = |text: String, parts: &[&str]| {
        for part in parts {
            assert!(text.contains(part), "`{part}` is missing in: {text}");
        }
    };
    check(
        text(&|s| s.joggles[1].length = mm(15.0)),
        &[
            "scene.tool.joggle_spar.joggles[1].length: given 15 mm",
            "at least 2",
        ],
    );
    check(
        text(&|s| s.joggles[0].start = mm(-300.0)),
        &["joggles[0].start", "rounded end"],
    );
    check(
        text(&|s| s.joggles[1].start = mm(-100.0)),
        &["joggles[1].start", "before the one above ends"],
    );
    check(
        text(&|s| s.joggles[1].start = mm(260.0)),
        &["joggles[1].start", "beyond the tool"],
    );
    check(
        text(&|s| s.fillet = mm(66.0)),
        &["fillet: given 66 mm", "at most 0.5 x `top_width`"],
    );
    check(
        text(&|s| {
            s.height = mm(14.0);
            (s.joggles[0].rise, s.joggles[1].rise) = (mm(-10.0), mm(10.0));
        }),
        &["height: given 14 mm", "higher than its fillet"],
    );
    check(
        text(&|s| s.corner = Some(mm(5.0))),
        &["corner: given 5 mm", "at least"],
    );
    check(
        text(&|s| s.length = mm(-1.0)),
        &["length: given -1 mm", "more than 0 mm"],
    );
    check(
        text(&|s| s.draft = Angle(1.4)),
        &["draft: given 80.214 deg"],
    );
}

/// A spar with the thesis' ratios of its ramps, 1:18 and 1:36.
fn recessed() -> RampedSpar {
    RampedSpar {
        length: mm(640.0),
        top_width: mm(120.0),
        height: mm(60.0),
        draft: Angle(0.1),
        fillet: mm(10.0),
        recess: mm(100.0),
        ramp: mm(180.0),
        depth: mm(10.0),
        side_depth: mm(5.0),
        facet_size: mm(5.0),
    }
}

#[test]
fn a_ramped_spar_falls_back_in_its_middle_by_depth_and_side_depth() {
    let spar = recessed();
    let mesh = build(&Tool::RampedSpar(spar)).unwrap();
    assert!(mesh.is_watertight() && mesh.longest_edge() <= 0.005);
    let top = |x: f64| {
        let near = mesh.points.iter().filter(|p| (p[0] - x).abs() < 3e-3);
        near.map(|p| p[2]).fold(0.0, f64::max)
    };
    assert!((top(0.0) - 0.050).abs() < 1e-9, "{}", top(0.0));
    assert!((top(0.28) - 0.060).abs() < 1e-9 && (top(-0.28) - 0.060).abs() < 1e-9);
    // At 30 mm over the bed the walls stand 5 mm further in, and nearer by the draft: the top is as far over it as it was.
    let wall = |x: f64| {
        let on = mesh.points.iter();
        let on = on.filter(|p| (p[0] - x).abs() < 3e-3 && (p[2] - 0.030).abs() < 2.5e-3);
        on.map(|p| p[1] + (p[2] - 0.030) * 0.1f64.tan())
            .fold(0.0, f64::max)
    };
    let inward = wall(0.25) - wall(0.0);
    assert!(
        (inward - 0.005 - 0.010 * 0.1f64.tan()).abs() < 1e-4,
        "{inward}"
    );
    // It is symmetric about both middle planes.
    let [lo, hi] = mesh.bounds();
    assert!((lo[0] + hi[0]).abs() < 1e-9 && (lo[1] + hi[1]).abs() < 1e-9);
}

#[test]
fn a_ramped_spar_tells_what_does_not_fit_in_its_own_words() {
    let told = |change: &dyn Fn(&mut RampedSpar)| {
        let mut spar = recessed();
        change(&mut spar);
        build(&Tool::RampedSpar(spar)).unwrap_err().to_string()
    };
    for (text, says) in [
        (
            told(&|s| s.recess = mm(250.0)),
            ["ramped_spar.recess: given 250 mm", "two ramps of 180 mm"],
        ),
        (
            told(&|s| s.ramp = mm(5.0)),
            ["ramped_spar.ramp: given 5 mm", "at least"],
        ),
        (
            told(&|s| s.depth = mm(-1.0)),
            ["ramped_spar.depth: given -1 mm", "at least 0 mm"],
        ),
        (
            told(&|s| s.height = mm(10.0)),
            ["ramped_spar.height: given 10 mm", "raise the tool"],
        ),
    ] {
        assert!(says.iter().all(|w| text.contains(w)), "{text}");
    }
}
