//! Values as users read them.

use plyflow_geometry::vec3::Vec3;

/// A place (m) for a reader.
pub fn in_mm(place: Vec3) -> String {
    let [x, y, z] = place.map(|c| 1e3 * c);
    format!("({x:.1}, {y:.1}, {z:.1}) mm")
}
