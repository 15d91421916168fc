//! Defects of surfaces whose answers are known: measured on a mesh, on a scan's facets and on a cloud of points.
//! A little over 600 lines: the surfaces are shared by all three ways to measure.

use plyflow_defects::scan::join;
use plyflow_defects::{
    Cause, Defect, Kind, Limits, Neighbour, Ply, Settings, Shape, Tool, find_causes, measure,
};
use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_surface::{Surface, Topology, triangles};
use std::f64::consts::PI;

/// The tool: a plane.
const TOP: f64 = 0.060;
/// Of the mid-plane from it.
const OFFSET: f64 = 0.0003;
const SETTINGS: Settings = Settings {
    distance_threshold: 0.001,
    curvature_threshold: 100.0,
    crest_hold: 0.3,
    foot_margin: 0.010,
    minimum_wrinkle_length: 0.010,
    minimum_bridging_area: 50e-6,
};

/// A wrinkle 3 mm high and 14 mm wide through (-35, 0) mm at `angle` (rad) to x that fades over 30 mm to both ends, and a round blister
/// 2 mm high of 25 mm radius at (40, 0) mm.
fn height(angle: f64, x: f64, y: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let (along, across) = (cos * (x + 0.035) + sin * y, -sin * (x + 0.035) + cos * y);
    let bump = |s: f64, half: f64| {
        if s.abs() < half {
            0.5 * (1.0 + (PI * s / half).cos())
        } else {
            0.0
        }
    };
    let fade = if along.abs() < 0.030 {
        (0.5 * PI * along / 0.030).cos()
    } else {
        0.0
    };
    0.003 * bump(across, 0.007) * fade + 0.002 * bump((x - 0.040).hypot(y), 0.025)
}

/// Length of the crest, over the surface, where it is curved beyond crest_hold of the threshold and stands off.
fn crest_length() -> f64 {
    let peak = 0.0015 * (PI / 0.007f64).powi(2);
    let curved = SETTINGS.crest_hold * SETTINGS.curvature_threshold / peak;
    let least = curved.max(SETTINGS.distance_threshold / 0.003);
    let half = 0.060 / PI * least.acos();
    let place = |i: i32| {
        let s = half * f64::from(i) / 500.0;
        [s, 0.0, 0.003 * (PI * s / 0.060).cos()]
    };
    (-500..500).map(|i| distance(place(i), place(i + 1))).sum()
}

/// Where the blister is higher than the threshold.
const BLISTER_AREA: f64 = PI * 0.0125 * 0.0125;

fn tool() -> Tool {
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
    let points = corners.map(|[x, y]| [x, y, TOP]);
    Tool::new(Surface::new(&points, &[[0, 1, 2], [0, 2, 3]]).unwrap())
}

/// Nodes over 160 x 100 mm in the plane, inner ones moved by up to `jitter` of the distance `h` (m).
fn flat(h: f64, jitter: f64) -> (Vec<[f64; 2]>, Vec<u32>) {
    let [n, m] = [0.160 / h, 0.100 / h].map(|n| n.round() as usize);
    let mut state = 1u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut points = Vec::new();
    for j in 0..=m {
        for i in 0..=n {
            let rim = i == 0 || j == 0 || i == n || j == m;
            let [dx, dy] = [0, 1].map(|_| if rim { 0.0 } else { jitter * h * random() });
            points.push([-0.080 + h * i as f64 + dx, -0.050 + h * j as f64 + dy]);
        }
    }
    let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let cells = (0..m)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .flat_map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
        .collect();
    (points, cells)
}

fn formed(flat: &[[f64; 2]], angle: f64) -> Vec<Vec3> {
    flat.iter()
        .map(|&[x, y]| [x, y, TOP + OFFSET + height(angle, x, y)])
        .collect()
}

fn ply(topology: Topology, formed: Vec<Vec3>) -> Ply {
    let undeformed = formed.iter().map(|p| [p[0], p[1], 0.0]).collect();
    Ply::new(
        "ply".into(),
        Shape {
            topology,
            undeformed,
            formed,
        },
        &tool(),
        OFFSET,
        SETTINGS.foot_margin,
    )
}

/// Errors of the wrinkle's length and amplitude and of the blister's area, over what is known.
fn errors(found: &[Defect]) -> [f64; 3] {
    let kinds: Vec<Kind> = found.iter().map(|d| d.kind).collect();
    assert_eq!(kinds, [Kind::Wrinkle, Kind::Bridging]);
    [
        found[0].length / crest_length() - 1.0,
        found[0].amplitude / 0.003 - 1.0,
        found[1].area / BLISTER_AREA - 1.0,
    ]
}

fn all(ply: &Ply) -> Vec<Defect> {
    measure(ply, &vec![true; ply.formed.len()], &SETTINGS)
}

#[test]
fn length_amplitude_and_area_are_within_3_percent_at_any_angle_and_on_jittered_meshes() {
    for degrees in [0.0, 22.5, 45.0, 70.0, 90.0] {
        for jitter in [0.0, 0.2] {
            let angle = f64::to_radians(degrees);
            let (points, cells) = flat(0.00125, jitter);
            let ply = ply(
                Topology::new(points.len(), 4, &cells),
                formed(&points, angle),
            );
            let found = all(&ply);
            let errors = errors(&found);
            println!("{degrees} deg, jitter {jitter}: {errors:.3?}");
            assert!(errors.iter().all(|e| e.abs() < 0.03), "{errors:?}");
            let turned = (found[0].direction - angle).sin().abs();
            assert!(turned < 0.03, "{degrees} {jitter}: {}", found[0].direction);
        }
    }
}

/// The place that is higher than the threshold is a disc of 12.5 mm: three elements of 8 mm across.
/// Rows of waves `height` (m) from trough to crest and `wave` (m) long, which touch the tool in their troughs: nodes `h` (m) apart along the surface, those inside
/// moved by `jitter` of that.
fn waves(height: f64, wave: f64, h: f64, jitter: f64) -> Ply {
    let at = |x: f64| 0.5 * height * (1.0 - (2.0 * PI * x / wave).cos());
    // Places x evenly along the arc, from trough to trough, three waves.
    let (mut places, mut arc, mut next) = (vec![0.0], 0.0, h);
    let steps = 60_000;
    for i in 0..steps {
        let [a, b] = [i, i + 1].map(|i| 3.0 * wave * f64::from(i) / f64::from(steps));
        arc += (b - a).hypot(at(b) - at(a));
        if arc >= next {
            places.push(b);
            next += h;
        }
    }
    let (n, m) = (places.len(), (0.030 / h).round() as usize);
    let mut state = 7u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut points = Vec::new();
    for j in 0..=m {
        for (i, x) in places.iter().enumerate() {
            let rim = i == 0 || j == 0 || i == n - 1 || j == m;
            let [dx, dy] = [0, 1].map(|_| if rim { 0.0 } else { jitter * h * random() });
            let slope = PI * height / wave * (2.0 * PI * x / wave).sin();
            let x = x + dx / (1.0 + slope * slope).sqrt();
            let y = 0.030 * j as f64 / m as f64 - 0.015 + dy;
            points.push([x - 1.5 * wave, y, TOP + OFFSET + at(x)]);
        }
    }
    let node = |i: usize, j: usize| (j * n + i) as u32;
    let cells: Vec<u32> = (0..m)
        .flat_map(|j| (0..n - 1).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            [
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ]
        })
        .collect();
    let topology = Topology::new(points.len(), 4, &cells);
    let mut ply = ply(topology, points);
    // As a scan, which knows no flat ply.
    ply.undeformed = ply.formed.clone();
    ply
}

#[test]
fn steep_waves_are_wrinkles_to_their_foot_and_as_long_as_their_crests() {
    for (height, wave, h, jitter) in [
        (0.010, 0.010, 1e-3, 0.0),
        (0.010, 0.010, 1e-3, 0.25),
        (0.006, 0.012, 0.8e-3, 0.25),
        (0.004, 0.016, 1e-3, 0.25),
    ] {
        let found = all(&waves(height, wave, h, jitter));
        let what = format!("{height} m high, {wave} m long, jitter {jitter}");
        let kinds: Vec<Kind> = found.iter().map(|d| d.kind).collect();
        assert_eq!(kinds, [Kind::Wrinkle; 3], "{what}");
        let length: f64 = found.iter().map(|d| d.length).sum();
        println!(
            "{what}: length {:.4}, sharpness {:.2}",
            length / 0.090,
            found[0].sharpness
        );
        assert!((length / 0.090 - 1.0).abs() < 0.03, "{what}: {length}");
        for d in &found {
            assert!(
                (d.amplitude / height - 1.0).abs() < 0.03,
                "{what}: {}",
                d.amplitude
            );
        }
        // The crest's curvature times the cell's size, where the mesh tells it.
        let turn = 0.5 * height * (2.0 * PI / wave).powi(2) * h;
        let sharp = found.iter().all(|d| d.sharpness > plyflow_surface::SHARP);
        assert!(turn < 1.0 || sharp, "{what}");
        assert!(turn > 0.4 || !sharp, "{what}");
    }
}

#[test]
fn the_top_of_a_wrinkle_between_two_nodes_is_found() {
    // Of a wave of which no node comes nearer to the top than half a cell.
    let (height, wave, h) = (0.003, 0.014, 1.75e-3);
    let at = |x: f64| 0.5 * height * (1.0 + (2.0 * PI * x / wave).cos());
    let points: Vec<Vec3> = (0..=16)
        .flat_map(|j| (0..8).map(move |i| (h * (f64::from(i) - 3.5), 0.00175 * f64::from(j))))
        .map(|(x, y)| [x, y, TOP + OFFSET + at(x)])
        .collect();
    let cells: Vec<u32> = (0..16u32)
        .flat_map(|j| (0..7u32).map(move |i| 8 * j + i))
        .flat_map(|i| [i, i + 1, i + 9, i + 8])
        .collect();
    let highest = points
        .iter()
        .fold(0.0f64, |m, p| m.max(p[2] - TOP - OFFSET));
    let found = all(&ply(Topology::new(points.len(), 4, &cells), points));
    assert!(highest / height < 0.965, "{highest}");
    let error = found[0].amplitude / height - 1.0;
    assert!(error.abs() < 0.01, "{error}");
}

#[test]
fn areas_do_not_jump_with_the_elements_of_a_coarse_mesh() {
    for (h, most) in [
        (0.0025, 0.003),
        (0.004, 0.006),
        (0.005, 0.01),
        (0.008, 0.03),
    ] {
        for jitter in [0.0, 0.2, 0.3] {
            let (points, cells) = flat(h, jitter);
            let ply = ply(Topology::new(points.len(), 4, &cells), formed(&points, 0.5));
            let found = all(&ply);
            let blister = found.iter().find(|d| d.kind == Kind::Bridging).unwrap();
            let error = blister.area / BLISTER_AREA - 1.0;
            let [x, y] = blister.centre;
            println!("{h}, jitter {jitter}: {error:.4} {x:.5} {y:.5}");
            assert!(error.abs() < most, "{h}, jitter {jitter}: {error}");
            assert!((x - 0.040).hypot(y) < 2e-4, "{h}, jitter {jitter}: {x} {y}");
        }
    }
}

/// What bridges a joggle: 1.5 mm high and 24 mm wide, around a line 60 mm long through the middle of the mesh at `angle` (rad) to x.
fn strip(angle: f64, x: f64, y: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let (along, across) = (cos * x + sin * y, -sin * x + cos * y);
    let from_line = (along.abs() - 0.030).max(0.0).hypot(across);
    0.00075 * (1.0 + (PI * from_line.min(0.012) / 0.012).cos())
}

#[test]
fn the_area_of_a_narrow_strip_is_known_with_two_elements_across() {
    // 9.4 mm wide where it is higher than the threshold. With one element across, slopes from the next nodes are too flat.
    let half_width = 0.012 / PI * (1.0f64 / 3.0).acos();
    let expected = 0.120 * half_width + PI * half_width * half_width;
    for (h, most) in [(0.002, 0.003), (0.004, 0.015), (0.008, 0.12)] {
        for degrees in [0.0, 20.0, 45.0, 70.0] {
            for jitter in [0.0, 0.2] {
                let (points, cells) = flat(h, jitter);
                let angle = f64::to_radians(degrees);
                let place = |[x, y]: &[f64; 2]| [*x, *y, TOP + OFFSET + strip(angle, *x, *y)];
                let formed = points.iter().map(place).collect();
                let found = all(&ply(Topology::new(points.len(), 4, &cells), formed));
                let area: f64 = found.iter().map(|d| d.area).sum();
                let error = area / expected - 1.0;
                println!("{h}, {degrees} deg, jitter {jitter}: {error:.4}");
                assert!(error.abs() < most, "{h} {degrees} {jitter}: {error}");
            }
        }
    }
}

/// A fold 3 mm high along y = 0 that widens from x = 0 on to two crests at y = +-x / 4, and fades over 45 mm to both ends.
fn widening(x: f64, y: f64) -> f64 {
    let half = 0.007;
    let bump = |s: f64| {
        if s.abs() < half {
            0.5 * (1.0 + (PI * s / half).cos())
        } else {
            0.0
        }
    };
    let apart = 0.25 * x.max(0.0);
    // While both reach the middle their sum there is the higher one.
    let highest = (2.0 * bump(apart)).max(1.0);
    let fade = if x.abs() < 0.045 {
        (0.5 * PI * x / 0.045).cos()
    } else {
        0.0
    };
    0.003 * fade * (bump(y - apart) + bump(y + apart)) / highest
}

#[test]
fn a_fold_that_widens_to_two_crests_is_one_wrinkle_from_end_to_end() {
    // Along the middle, then along either crest, to where the fold is as high as it has to be.
    let least = SETTINGS.distance_threshold / 0.003;
    let end = 0.045 * 2.0 / PI * least.acos();
    let place = |i: i32| {
        let x = end * f64::from(i) / 1000.0;
        let y = 0.25 * x.max(0.0);
        [x, y, widening(x, y)]
    };
    let known: f64 = (-1000..1000)
        .map(|i| distance(place(i), place(i + 1)))
        .sum();
    for (h, jitter) in [(0.00125, 0.0), (0.00125, 0.2), (0.002, 0.0)] {
        let (points, cells) = flat(h, jitter);
        let formed = points
            .iter()
            .map(|&[x, y]| [x, y, TOP + OFFSET + widening(x, y)])
            .collect();
        let found = all(&ply(Topology::new(points.len(), 4, &cells), formed));
        assert_eq!(found.len(), 1, "{h}, jitter {jitter}: {found:?}");
        let errors = [found[0].length / known, found[0].amplitude / 0.003].map(|r| r - 1.0);
        println!("{h}, jitter {jitter}: {errors:.3?}");
        assert!(errors.iter().all(|e| e.abs() < 0.03), "{errors:?}");
    }
}

/// A tool along x that goes up by 30 deg to both sides of a hollow bend of this radius (m) at x = 0.
const HOLLOW: f64 = 0.008;

/// Its place and normal at `s` along it, from the middle of the bend.
fn hollow(s: f64) -> [Vec3; 2] {
    let angle = (s / HOLLOW).clamp(-PI / 6.0, PI / 6.0);
    let (sin, cos) = angle.sin_cos();
    let straight = s - angle * HOLLOW;
    let x = HOLLOW * sin + straight * cos;
    let z = TOP + HOLLOW * (1.0 - cos) + straight * sin;
    [[x, 0.0, z], [-sin, 0.0, cos]]
}

/// In the bend the crest line of a wrinkle 2 mm high and 16 mm wide is curved more, and to the other side, than the crest across it: by 175 and by 154 1/m.
#[test]
fn a_crest_goes_on_through_a_hollow_bend_of_the_tool() {
    let above = |s: f64, y: f64, height: f64| {
        let [p, n] = hollow(s);
        [p[0] + height * n[0], y, p[2] + height * n[2]]
    };
    let stations: Vec<f64> = (0..=600).map(|i| -0.15 + 0.0005 * f64::from(i)).collect();
    let points: Vec<Vec3> = [-0.3, 0.3]
        .iter()
        .flat_map(|&y| stations.iter().map(move |&s| above(s, y, 0.0)))
        .collect();
    let n = stations.len() as u32;
    let facets: Vec<[u32; 3]> = (0..n - 1)
        .flat_map(|i| [[i, i + 1, n + i + 1], [i, n + i + 1, n + i]])
        .collect();
    let tool = Tool::new(Surface::new(&points, &facets).unwrap());
    let height = |s: f64, y: f64| {
        let fade = if s.abs() < 0.030 {
            (0.5 * PI * s / 0.030).cos()
        } else {
            0.0
        };
        let bump = if y.abs() < 0.008 {
            0.5 * (1.0 + (PI * y / 0.008).cos())
        } else {
            0.0
        };
        0.002 * bump * fade
    };
    // To where it is as high as it has to be.
    let end = 0.060 / PI * 0.5f64.acos();
    let place = |i: i32| {
        let s = end * f64::from(i) / 1000.0;
        above(s, 0.0, OFFSET + height(s, 0.0))
    };
    let known: f64 = (-1000..1000)
        .map(|i| distance(place(i), place(i + 1)))
        .sum();
    for (h, jitter) in [(0.00125, 0.0), (0.00125, 0.2), (0.002, 0.0)] {
        let (points, cells) = flat(h, jitter);
        let formed: Vec<Vec3> = points
            .iter()
            .map(|&[s, y]| above(s, y, OFFSET + height(s, y)))
            .collect();
        let undeformed = points.iter().map(|&[s, y]| [s, y, 0.0]).collect();
        let ply = Ply::new(
            "ply".into(),
            Shape {
                topology: Topology::new(points.len(), 4, &cells),
                undeformed,
                formed,
            },
            &tool,
            OFFSET,
            // The bend is the lowest of this tool.
            0.0,
        );
        let found = all(&ply);
        assert_eq!(found.len(), 1, "{h}, jitter {jitter}: {found:?}");
        let errors = [found[0].length / known, found[0].amplitude / 0.002].map(|r| r - 1.0);
        println!("{h}, jitter {jitter}: {errors:.3?}");
        assert!(errors.iter().all(|e| e.abs() < 0.03), "{errors:?}");
    }
}

#[test]
fn a_cloud_of_points_is_joined_to_the_whole_surface_and_measured_as_a_mesh_is() {
    for jitter in [0.0, 0.3] {
        let (points, cells) = flat(0.00125, jitter);
        let points = formed(&points, 0.5);
        let joined = join(&points, |_| [0.0, 0.0, 1.0]);
        let topology = Topology::new(points.len(), 3, joined.as_flattened());
        // A disc: nodes - edges + triangles = 1, with the rim of the mesh.
        let rim = Topology::new(points.len(), 4, &cells).free_edges().len();
        let edges = (3 * joined.len() + topology.free_edges().len()) / 2;
        assert_eq!(topology.free_edges().len(), rim, "jitter {jitter}");
        assert_eq!(points.len() + joined.len(), edges + 1, "jitter {jitter}");
        let up = triangles(3, joined.as_flattened());
        assert!(
            Surface::new(&points, &up)
                .unwrap()
                .closest([0.0, 0.0, 1.0])
                .signed_distance
                > 0.0
        );
        let errors = errors(&all(&ply(topology, points)));
        println!("cloud, jitter {jitter}: {errors:.3?}");
        assert!(errors.iter().all(|e| e.abs() < 0.03), "{errors:?}");
    }
}

#[test]
fn a_ply_that_is_wound_the_other_way_round_has_the_same_defects() {
    let (points, cells) = flat(0.002, 0.0);
    let measured = |cells: &[u32]| {
        let topology = Topology::new(points.len(), 4, cells);
        all(&ply(topology, formed(&points, 0.5)))
    };
    let right = measured(&cells);
    let reversed: Vec<u32> = cells
        .chunks(4)
        .flat_map(|c| c.iter().rev().copied())
        .collect();
    let errors = errors(&measured(&reversed));
    assert!(errors.iter().all(|e| e.abs() < 0.03), "{errors:?}");
    for (a, b) in right.iter().zip(&measured(&reversed)) {
        assert!(
            (a.length - b.length).abs() < 1e-9,
            "{} {}",
            a.length,
            b.length
        );
        assert_eq!(a.nodes, b.nodes);
    }
}

/// Shear 10 degrees along the wrinkle: over-shear. Less: the blister is near, or it is not. Far from it, under a ply turned by 45
/// degrees: pressed together if its fibres are, or if they are without such a ply.
#[test]
fn causes_follow_from_the_fields() {
    let (points, cells) = flat(0.00125, 0.0);
    let mut ply = ply(Topology::new(points.len(), 4, &cells), formed(&points, 0.5));
    let limits = |reach: f64| Limits {
        over_shear_positive: Some(8f64.to_radians()),
        over_shear_negative: Some(-50f64.to_radians()),
        bridging_reach: reach,
        layup_angle: 5f64.to_radians(),
        fibre_compression: 1e-4,
    };
    let own = [-PI / 4.0, PI / 4.0];
    // As large as the ply itself, but by the wrinkle alone, and beside it.
    let other = |b: [f64; 4]| {
        let corners = [[b[0], b[1]], [b[2], b[1]], [b[2], b[3]], [b[0], b[3]]];
        let flat = corners.map(|[x, y]| [x, y, 0.0]);
        let topology = Topology::new(4, 4, &[0, 1, 2, 3]);
        Ply::new(
            "other".into(),
            Shape {
                topology,
                undeformed: flat.into(),
                formed: flat.into(),
            },
            &tool(),
            0.0,
            0.0,
        )
    };
    let (around, beside) = (
        other([-0.08, -0.05, 0.08, 0.05]),
        other([0.0, -0.05, 0.08, 0.05]),
    );
    let cause_under = |ply: &Ply, other: &Ply, others: &[[f64; 2]], reach: f64| {
        let mut found = all(ply);
        let with = |fibres: &[f64; 2]| Neighbour {
            ply: other,
            fibres: *fibres,
        };
        let others: Vec<Neighbour<'_>> = others.iter().map(with).collect();
        find_causes(ply, &mut found, Some(own), &others, &limits(reach));
        assert_eq!(found[1].cause, None);
        found[0].cause.unwrap()
    };
    let cause = |ply: &Ply, others: &[[f64; 2]], reach| cause_under(ply, &around, others, reach);
    let n = cells.len() / 4;
    let turned = [[0.0, PI / 2.0]];
    assert_eq!(cause(&ply, &[], 0.02), Cause::Undetermined);
    assert_eq!(cause(&ply, &[], 0.05), Cause::Bridging);
    ply.shear_angle = vec![0.1745; n];
    assert_eq!(cause(&ply, &turned, 0.05), Cause::OverShear);
    ply.shear_angle = vec![-0.1745; n];
    ply.fibre_strain = vec![-2e-4; n];
    assert_eq!(cause(&ply, &turned, 0.05), Cause::Bridging);
    assert_eq!(cause(&ply, &turned, 0.02), Cause::InterPlyCompression);
    // A ply that lies beside the wrinkle does nothing to it.
    let alone = cause_under(&ply, &beside, &turned, 0.02);
    assert_eq!(alone, Cause::FibreCompression);
    // The same directions, named the other way round and turned by half a turn: one layup, pressed together by itself.
    assert_eq!(
        cause(&ply, &[[PI / 4.0, 0.75 * PI]], 0.02),
        Cause::FibreCompression
    );
    assert_eq!(cause(&ply, &[], 0.02), Cause::FibreCompression);
    // Next to nothing is no compression.
    ply.fibre_strain = vec![-5e-5; n];
    assert_eq!(cause(&ply, &turned, 0.02), Cause::Undetermined);
    assert_eq!(cause(&ply, &[], 0.02), Cause::Undetermined);
    ply.fibre_strain = vec![1e-4; n];
    assert_eq!(cause(&ply, &turned, 0.02), Cause::Undetermined);
}

/// A block of 200 x 140 mm whose long edges are rounded by 1.5 mm, as a file has it: between these the top has two facets for every 20 mm. What is known at their
/// corners, on the rounded edges, says nothing of their middle, where the wrinkle lies.
#[test]
fn a_wrinkle_over_a_large_facet_between_fillets_is_measured_as_on_a_plane() {
    let (r, half) = (0.0015, [0.100, 0.070]);
    let rim = (0..=9).map(|k| 0.5 * PI * f64::from(k) / 9.0);
    let rim: Vec<[f64; 2]> = rim
        .map(|a| [half[1] - r + r * a.cos(), r * (a.sin() - 1.0)])
        .collect();
    let mut profile = vec![[half[1], -0.04]];
    profile.extend(&rim);
    profile.extend(rim.iter().rev().map(|[y, z]| [-y, *z]));
    profile.push([-half[1], -0.04]);
    let points: Vec<Vec3> = (0..=10)
        .map(|i| half[0] * (0.2 * f64::from(i) - 1.0))
        .flat_map(|x| profile.iter().map(move |[y, z]| [x, *y, TOP + z]))
        .collect();
    let m = profile.len() as u32;
    let facets: Vec<[u32; 3]> = (0..10)
        .flat_map(|i| (0..m - 1).map(move |j| i * m + j))
        .flat_map(|a| [[a, a + m + 1, a + m], [a, a + 1, a + m + 1]])
        .collect();
    let block = Tool::new(Surface::new(&points, &facets).unwrap());
    let (plane, cells) = flat(0.00125, 0.0);
    let bumps = formed(&plane, 0.0);
    let on = |tool: &Tool| {
        let topology = Topology::new(bumps.len(), 4, &cells);
        let undeformed = bumps.iter().map(|p| [p[0], p[1], 0.0]).collect();
        let margin = SETTINGS.foot_margin;
        let ply = Ply::new(
            "ply".into(),
            Shape {
                topology,
                undeformed,
                formed: bumps.clone(),
            },
            tool,
            OFFSET,
            margin,
        );
        measure(&ply, &vec![true; bumps.len()], &SETTINGS)
    };
    let (found, expected) = (on(&block), on(&tool()));
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(&expected) {
        assert_eq!(a.kind, b.kind);
        assert!((a.length - b.length).abs() < 1e-6 && (a.area - b.area).abs() < 1e-9);
    }
}
