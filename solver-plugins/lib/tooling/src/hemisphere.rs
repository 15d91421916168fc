//! Half a sphere on the bed.

use crate::chord::CHORD_TOLERANCE;
use crate::mesh::ToolMesh;
use crate::sweep::arc_step;
use plyflow_geometry::vec3::{Vec3, scale, slerp};
use std::f64::consts::FRAC_PI_2;

/// Four octants, each divided evenly; the bottom is the same net pressed flat.
pub(crate) fn hemisphere(radius: f64, facet: f64) -> ToolMesh {
    let mut n = (FRAC_PI_2 / arc_step(radius, CHORD_TOLERANCE, facet))
        .ceil()
        .max(2.0) as usize;
    loop {
        let mesh = divided(radius, n);
        if mesh.longest_edge() <= facet {
            return mesh;
        }
        n += n / 8 + 1;
    }
}

/// Ring i (from the pole, i = 0..=n) has 4 i points; i along the meridians, quarter by quarter.
fn divided(radius: f64, n: usize) -> ToolMesh {
    let mut mesh = ToolMesh::default();
    let dome = rings(&mut mesh, n, |i, quarter, j| {
        let [a, b] = axes(quarter);
        let (i, j) = (i as f64, j as f64);
        let pole = slerp([0.0, 0.0, 1.0], a, i / n as f64);
        let far = slerp([0.0, 0.0, 1.0], b, i / n as f64);
        scale(slerp(pole, far, if i > 0.0 { j / i } else { 0.0 }), radius)
    });
    let equator = dome[n].clone();
    strips(&mut mesh, &dome, false);
    let mut disc = rings(&mut mesh, n - 1, |i, quarter, j| {
        let [a, b] = axes(quarter);
        let w = if i > 0 { j as f64 / i as f64 } else { 0.0 };
        scale(slerp(a, b, w), radius * i as f64 / n as f64)
    });
    disc.push(equator);
    strips(&mut mesh, &disc, true);
    mesh
}

/// Points of the rings 0..=n, each ring once around.
fn rings(mesh: &mut ToolMesh, n: usize, at: impl Fn(usize, usize, usize) -> Vec3) -> Vec<Vec<u32>> {
    (0..=n)
        .map(|i| {
            if i == 0 {
                return vec![mesh.push(at(0, 0, 0))];
            }
            (0..4 * i).map(|k| mesh.push(at(i, k / i, k % i))).collect()
        })
        .collect()
}

/// Facets between neighbouring rings; outwards is up, or down when `flip`.
fn strips(mesh: &mut ToolMesh, rings: &[Vec<u32>], flip: bool) {
    let mut facet = |a: u32, b: u32, c: u32| {
        mesh.triangles
            .push(if flip { [a, c, b] } else { [a, b, c] });
    };
    for i in 0..rings.len() - 1 {
        let (inner, outer) = (&rings[i], &rings[i + 1]);
        let at = |ring: &[u32], quarter: usize, j: usize, per: usize| {
            ring[(quarter * per + j) % ring.len()]
        };
        for quarter in 0..4 {
            for j in 0..=i {
                let a = at(inner, quarter, j, i);
                let (b, c) = (
                    at(outer, quarter, j, i + 1),
                    at(outer, quarter, j + 1, i + 1),
                );
                facet(a, b, c);
                if j < i {
                    facet(a, c, at(inner, quarter, j + 1, i));
                }
            }
        }
    }
}

/// The quarter's two horizontal directions.
fn axes(quarter: usize) -> [Vec3; 2] {
    const AXES: [Vec3; 4] = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
    ];
    [AXES[quarter], AXES[(quarter + 1) % 4]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn area_and_volume_approach_the_closed_form_with_second_order() {
        let r = 0.05;
        let (area, volume) = (3.0 * PI * r * r, 2.0 / 3.0 * PI * r.powi(3));
        let error = |n: usize| {
            let mesh = divided(r, n);
            assert!(mesh.is_watertight());
            [1.0 - mesh.area() / area, 1.0 - mesh.volume() / volume]
        };
        let (coarse, fine) = (error(20), error(40));
        for k in 0..2 {
            let order = (coarse[k] / fine[k]).log2();
            assert!((order - 2.0).abs() < 0.1, "order {order}");
            assert!(fine[k] > 0.0 && fine[k] < 1e-3, "error {}", fine[k]);
        }
    }

    #[test]
    fn facets_keep_their_size_and_stand_on_the_bed() {
        let mesh = hemisphere(0.05, 0.004);
        assert!(mesh.longest_edge() <= 0.004);
        let [lo, hi] = mesh.bounds();
        assert!(lo[2].abs() < 1e-12 && (hi[2] - 0.05).abs() < 1e-12);
    }
}
