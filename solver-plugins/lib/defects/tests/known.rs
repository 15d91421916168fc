//! Defects of surfaces whose answers are known, measured on a mesh.

mod common;

use common::*;
use plyflow_defects::{Kind, Ply};
use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_surface::Topology;
use std::f64::consts::PI;

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
