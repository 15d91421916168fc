//! Defects of the same surfaces on other tools, on a scan's facets and on a cloud of points, and what brought them about.

mod common;

use common::*;
use plyflow_defects::scan::join;
use plyflow_defects::{Cause, Limits, Neighbour, Ply, Shape, Tool, find_causes, measure};
use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_model::steering::Laid;
use plyflow_surface::{Ground, Surface, Topology, triangles};
use std::f64::consts::PI;

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
            Ground::bed(0.0),
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
            Ground::bed(0.0),
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
            laid: Laid::Straight(*fibres),
        };
        let others: Vec<Neighbour<'_>> = others.iter().map(with).collect();
        find_causes(
            ply,
            &mut found,
            Some(&Laid::Straight(own)),
            &others,
            &limits(reach),
        );
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
    // Of a steered ply the direction at the wrinkle counts, which lies at x < 0, and not that beside it.
    let steered = |there: f64, beside: f64| {
        let points = [
            (-0.08, there),
            (-0.001, there),
            (0.001, beside),
            (0.08, beside),
        ];
        let laid = Laid::steered(points.map(|(x, angle)| [x, 0.0, angle]).to_vec()).unwrap();
        let mut found = all(&ply);
        let other = Neighbour { ply: &around, laid };
        find_causes(
            &ply,
            &mut found,
            Some(&Laid::Straight(own)),
            &[other],
            &limits(0.02),
        );
        found[0].cause.unwrap()
    };
    assert_eq!(steered(0.0, own[0]), Cause::InterPlyCompression);
    assert_eq!(steered(own[0], 0.0), Cause::FibreCompression);
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
        let margin = Ground::bed(SETTINGS.foot_margin);
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
