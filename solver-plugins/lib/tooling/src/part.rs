//! Rigid parts of a stamping besides the scene's tool: their triangles where they are drawn, and what contacts see of them.

use crate::audit::FieldError;
use crate::build::built;
use crate::checks::{check_unit, check_walls};
use crate::double_dome;
use crate::given::field_of;
use crate::mesh::ToolMesh;
use crate::sdf::SignedDistanceGrid;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::scene::{Scene, Side, Stamping, StampingPart, Tool};
use plyflow_model::tool::placed::Placed;

/// A part that passed all checks.
pub struct PartTool {
    /// Its triangles where it is drawn.
    pub mesh: ToolMesh,
    /// What contacts see.
    pub field: PartField,
    /// By how much both differ at most, and where.
    pub error: FieldError,
}

/// Signed distance to a part.
///
/// A field takes its tool to stand on its lowest facets, and leaves these out. A part above the sheets hangs from its highest ones, and its
/// lowest ones are those that touch: its field is that of the part turned over.
#[derive(Debug, Clone)]
pub struct PartField {
    grid: SignedDistanceGrid,
    hangs: bool,
}

/// A half turn about the x axis.
fn over([x, y, z]: Vec3) -> Vec3 {
    [x, -y, -z]
}

impl PartField {
    /// Of a tool that stands.
    pub fn standing(grid: SignedDistanceGrid) -> Self {
        Self { grid, hangs: false }
    }

    /// Signed distance (m), positive outside, and its gradient (dimensionless, nearly unit length) at a point: as
    /// [`SignedDistanceGrid::distance_and_gradient`].
    #[inline]
    pub fn distance_and_gradient(&self, p: Vec3) -> (f64, Vec3) {
        if self.hangs {
            let (distance, gradient) = self.grid.distance_and_gradient(over(p));
            (distance, over(gradient))
        } else {
            self.grid.distance_and_gradient(p)
        }
    }
}

/// What a stamping says of the part at place `k` of its list.
fn words(stamping: &Stamping, k: usize) -> (&StampingPart, String) {
    let part = &stamping.parts[k];
    (part, format!("scene.process.stamping.parts[{k}]"))
}

/// The triangles of the part at place `k` of the stamping's list, which is not the scene's own tool, where it is drawn.
///
/// # Errors
/// A text for the user, with the part's place in the scene: it has no surface, is a speck beside `spacing` (m), or has walls thinner than a ply.
fn triangles(
    scene: &Scene,
    stamping: &Stamping,
    k: usize,
    spacing: f64,
) -> Result<ToolMesh, String> {
    let (part, at) = words(stamping, k);
    // The checks of tools speak of the scene's tool.
    let told = |text: String| match text.contains("scene.tool") {
        true => text.replace("scene.tool", &format!("{at}.tool")),
        false => format!("{at} (`{}`): {text}", part.name),
    };
    if let Some(die) = &part.matching {
        let Tool::DoubleDome(dome) = &scene.tool else {
            return Err(format!(
                "{at}.matching: the scene's tool is no `double_dome`"
            ));
        };
        let mesh = double_dome::die(dome, die).map_err(|text| format!("{at}.matching: {text}"))?;
        return Ok(mesh);
    }
    let Some(tool) = &part.tool else {
        return Err(format!("{at}: the part `{}` has no surface", part.name));
    };
    let mut of_part = scene.clone();
    of_part.tool = tool.clone();
    let mut built = built(tool).map_err(|e| told(e.to_string()))?;
    let placed = Placed::of(&part.place(), 1.0, built.mesh.points.iter())
        .ok_or_else(|| told("it has no point, or one that is not finite".into()))?;
    for p in &mut built.mesh.points {
        *p = placed.put(*p);
    }
    check_unit(&of_part, &built.mesh, spacing).map_err(told)?;
    check_walls(&of_part, &built.mesh).map_err(told)?;
    Ok(built.mesh)
}

/// The part at place `k` of the stamping's list, with a distance field whose points are `spacing` (m) apart, and more where the part is sharper.
///
/// # Errors
/// As [`triangles`]; and where the field is off by more than a tenth of the thinnest ply, with the spacing that would do.
pub fn rigid(
    scene: &Scene,
    stamping: &Stamping,
    k: usize,
    spacing: f64,
) -> Result<PartTool, String> {
    let (part, at) = words(stamping, k);
    let mesh = triangles(scene, stamping, k, spacing)?;
    let hangs = part.side == Side::Above;
    let told = |text: String| text.replace("scene.tool", &format!("{at} (`{}`)", part.name));
    let (grid, error) = if hangs {
        let turned = ToolMesh {
            points: mesh.points.iter().map(|p| over(*p)).collect(),
            triangles: mesh.triangles.clone(),
        };
        field_of(scene, &turned, spacing, &|_| true, over)
    } else {
        field_of(scene, &mesh, spacing, &|_| true, |p| p)
    }
    .map_err(told)?;
    Ok(PartTool {
        mesh,
        field: PartField { grid, hangs },
        error,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// A scene whose tool is a block, with this part.
    fn scene(part: Value) -> Scene {
        let material = json!({"plyflow_material": 1, "name": "m", "plugin": "material-fabric", "thickness": "0.4 mm", "areal_mass": "0.4 kg/m2", "with": {}});
        let scene = json!({
            "plyflow_scene": 1, "name": "s",
            "tool": {"flat": {"length": "60 mm", "width": "40 mm", "height": "10 mm", "fillet": "2 mm", "facet_size": "5 mm"}},
            "sheets": [{"name": "a", "kind": "ply", "material": material, "length": "80 mm", "width": "60 mm", "fibre_1": "0 deg", "fibre_2": "90 deg"}],
            "friction": {"tool_fabric": 0.2},
            "process": {"stamping": {"forming_time": "100 ms", "settling_time": "10 ms", "parts": [part]}}
        });
        Scene::from_json(scene).unwrap_or_else(|e| panic!("{e}"))
    }

    fn made(part: Value) -> Result<PartTool, String> {
        let scene = scene(part);
        let plyflow_model::scene::Process::Stamping(stamping) = &scene.process else {
            unreachable!()
        };
        rigid(&scene, stamping, 0, 2e-3)
    }

    fn block(height: &str) -> Value {
        json!({"flat": {"length": "50 mm", "width": "30 mm", "height": height, "fillet": "2 mm", "facet_size": "5 mm"}})
    }

    #[test]
    fn a_part_that_hangs_is_met_at_its_lowest_face_and_one_that_stands_at_its_highest() {
        for (side, up, away) in [("above", "-z", -1.0), ("below", "+z", 1.0)] {
            let part = json!({"name": "pad", "side": side, "tool": block("8 mm"), "up": up, "centre": ["10 mm", "5 mm"], "foot": "20 mm"});
            let made = made(part).unwrap();
            let [low, high] = made.mesh.bounds();
            for (found, expected) in [(low, [-0.015, -0.01, 0.02]), (high, [0.035, 0.02, 0.028])] {
                for k in 0..3 {
                    assert!((found[k] - expected[k]).abs() < 1e-9, "{found:?}");
                }
            }
            // 1 mm off the face that touches, and 1 mm in it.
            let face = if side == "above" { 0.02 } else { 0.028 };
            for off in [1e-3, -1e-3] {
                let (distance, gradient) =
                    made.field
                        .distance_and_gradient([0.01, 0.005, face + away * off]);
                assert!((distance - off).abs() < 1e-5, "{side}: {distance}");
                assert!((gradient[2] - away).abs() < 1e-3, "{side}: {gradient:?}");
            }
            // Beside its wall, in x and y alike.
            let (distance, gradient) = made.field.distance_and_gradient([0.01, 0.022, 0.024]);
            assert!(
                (distance - 2e-3).abs() < 1e-5 && gradient[1] > 0.99,
                "{side}: {distance} {gradient:?}"
            );
        }
    }

    #[test]
    fn what_is_no_part_is_told_with_its_place_in_the_scene() {
        let told = |tool: Value| {
            let part = json!({"name": "pad", "side": "below", "tool": tool});
            made(part).err().expect("refused")
        };
        let speck = told(
            json!({"flat": {"length": "3 mm", "width": "3 mm", "height": "2 mm", "fillet": "0.5 mm", "facet_size": "1 mm"}}),
        );
        assert!(
            speck.starts_with("scene.process.stamping.parts[0].tool"),
            "{speck}"
        );
        let file = told(json!({"stl": {"file": "nowhere.stl", "unit": "1 mm"}}));
        assert!(
            file.starts_with("scene.process.stamping.parts[0] (`pad`): tool file nowhere.stl"),
            "{file}"
        );
        let unread = told(json!({"input": {"body": "block"}}));
        assert!(unread.contains("parts[0].tool.input.body"), "{unread}");
    }
}
