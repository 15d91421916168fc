//! How much of a tool lies under an opening.

use crate::mesh::ToolMesh;
use plyflow_geometry::rectangle::Rectangle;
use plyflow_geometry::vec3::{Vec3, mix};

/// What lies on the side of a plane on which `side` (m, linear over the polygon) is not negative.
fn clipped(polygon: &[Vec3], side: impl Fn(Vec3) -> f64) -> Vec<Vec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        let (da, db) = (side(*a), side(b));
        if da >= 0.0 {
            kept.push(*a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            let t = da / (da - db);
            kept.push(mix(1.0 - t, *a, t, b));
        }
    }
    kept
}

/// Area (m2) of the plan of a polygon, and the integral (m3) of the height over `base` (m) over it; both negative where it looks down.
fn under(polygon: &[Vec3], base: f64) -> [f64; 2] {
    let Some(first) = polygon.first() else {
        return [0.0; 2];
    };
    let of = |two: &[Vec3]| {
        let [a, b] = [two[0], two[1]].map(|p| [p[0] - first[0], p[1] - first[1]]);
        let height = (first[2] + two[0][2] + two[1][2]) / 3.0 - base;
        let area = 0.5 * (a[0] * b[1] - a[1] * b[0]);
        [area, area * height]
    };
    polygon[1..].windows(2).map(of).fold([0.0; 2], sum)
}

fn sum(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

impl ToolMesh {
    /// Of what lies over `base` (m) and under an opening, a rectangle in plan (m): its area (m2) at `base`, and its volume (m3). The tool is closed, or
    /// open only at a foot that lies no higher than `base`. What lies in several bodies counts once, as in [`ToolMesh::volume`].
    pub fn column(&self, opening: Rectangle, base: f64) -> [f64; 2] {
        let sides = |polygon: Vec<Vec3>| {
            (0..2).fold(polygon, |kept, d| {
                let kept = clipped(&kept, |p| p[d] - opening[d]);
                clipped(&kept, |p| opening[d + 2] - p[d])
            })
        };
        let of = |triangle: &[u32; 3]| {
            let corners = triangle.map(|n| self.points[n as usize]);
            under(&clipped(&sides(corners.to_vec()), |p| p[2] - base), base)
        };
        let [area, volume] = self.triangles.iter().map(of).fold([0.0; 2], sum);
        let again = self.counted_again(opening, base);
        [area - again[0], volume - again[1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_model::scene::Tool;
    use serde_json::json;

    /// A block of 60 x 40 x 10 mm, with edges that are nearly sharp.
    fn block() -> ToolMesh {
        let tool = json!({"flat": {"length": "60 mm", "width": "40 mm", "height": "10 mm", "fillet": "0.01 mm", "facet_size": "7 mm"}});
        let tool: Tool = serde_json::from_value(tool).unwrap();
        crate::build::built(&tool).unwrap().mesh
    }

    #[test]
    fn an_opening_over_all_of_a_tool_has_its_whole_volume_and_one_inside_its_column() {
        let block = block();
        let [_, wide] = block.column([-1.0, -1.0, 1.0, 1.0], 0.0);
        assert!((wide / block.volume() - 1.0).abs() < 1e-12, "{wide}");
        for (opening, base, expected) in [
            ([-0.02, -0.01, 0.013, 0.011], 0.0, 0.033 * 0.021 * 0.01),
            ([-0.02, -0.01, 0.013, 0.011], 0.004, 0.033 * 0.021 * 0.006),
            // Half of it lies beside the tool.
            ([0.01, -0.01, 0.05, 0.01], 0.0, 0.02 * 0.02 * 0.01),
            ([-0.02, -0.01, 0.013, 0.011], 0.012, 0.0),
            ([0.04, -0.01, 0.05, 0.01], 0.0, 0.0),
        ] {
            let [area, volume] = block.column(opening, base);
            // On the foot what looks up and what looks down add up to nothing.
            let section = match base {
                0.0 => 0.0,
                _ => expected / (0.01f64 - base).abs(),
            };
            assert!(
                (area - section).abs() < 1e-9,
                "{opening:?} over {base}: {area} m2"
            );
            assert!(
                (volume - expected).abs() < 1e-11,
                "{opening:?} over {base}: {volume}, expected {expected}"
            );
        }
    }
}
