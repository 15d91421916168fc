//! The sheets of a scene as they lie one on the other.

use crate::error::{FormingError, Result};
use plyflow_blank::Blank;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::crossed::Crossed;
use plyflow_mechanics::mirror::Planes;
use plyflow_mechanics::sheet::SteeredAxes;
use plyflow_model::material::{Material, MaterialEntry};
use plyflow_model::rules;
use plyflow_model::scene::{Laid, Scene, Sheet, SheetKind};

/// A sheet of the stack with what the contacts and the output need.
#[derive(Debug, Clone)]
pub struct StackSheet {
    /// The scene's words.
    pub scene: Sheet,
    /// Its material.
    pub material: Material,
    /// Directions of its fibres before forming.
    pub laid: Laid,
    /// Thickness (m).
    pub thickness: f64,
    /// Distance of its mid-plane from the tool surface when the stack is compact (m).
    pub offset: f64,
}

impl StackSheet {
    /// Whether it is a ply, not a film.
    pub fn is_ply(&self) -> bool {
        self.scene.kind == SheetKind::Ply
    }

    /// How its families cross, where they do not at a right angle.
    pub fn crossed(&self) -> Option<Crossed> {
        self.laid.crossing().map(Crossed::new)
    }

    /// Direction of material axis e1 at a place of the undeformed plane (m).
    pub fn axis_at(&self, place: [f64; 2]) -> Vec3 {
        let e1 = self.laid.axis_at(place);
        [e1.fixed_cos(), e1.fixed_sin(), 0.0]
    }

    /// As [`StackSheet::axis_at`], in the middle of a cell whose corners were at `then` (m) before forming.
    pub fn axis_in_cell(&self, then: &[Vec3; 4]) -> Vec3 {
        let middle = |k: usize| 0.25 * then.iter().map(|c| c[k]).sum::<f64>();
        self.axis_at([middle(0), middle(1)])
    }

    /// Directions of e1 in the cells and at the nodes of its flat mesh (`points`, m; `cells` in their numbers); `None` where its fibres are straight.
    pub fn steered(&self, points: &[Vec3], cells: &[[u32; 4]]) -> Option<SteeredAxes> {
        matches!(self.laid, Laid::Steered(_)).then(|| SteeredAxes {
            cells: (cells.iter())
                .map(|c| self.axis_in_cell(&c.map(|n| points[n as usize])))
                .collect(),
            nodes: points.iter().map(|p| self.axis_at([p[0], p[1]])).collect(),
        })
    }
}

/// The stack of a scene, bottom to top, with offsets.
///
/// # Errors
/// When the scene breaks a rule ([`rules::check`]), or has fibres that the solver cannot compute.
pub fn stack(scene: &Scene) -> Result<Vec<StackSheet>> {
    rules::check(scene)?;
    let mut stack = scene
        .sheets
        .iter()
        .map(|sheet| {
            let MaterialEntry::Inline(material) = &sheet.material else {
                return Err(FormingError::Scene(format!(
                    "the material of sheet '{}' was not read in",
                    sheet.name
                )));
            };
            check_sheet(sheet, material)?;
            let laid = sheet.laid().map_err(|e| {
                FormingError::Scene(format!("fibre_1 of sheet '{}': {e}", sheet.name))
            })?;
            Ok(StackSheet {
                laid,
                scene: sheet.clone(),
                material: (**material).clone(),
                thickness: material.thickness.si(),
                offset: 0.0,
            })
        })
        .collect::<Result<Vec<_>>>()?;
    lay(&mut stack);
    Ok(stack)
}

/// Lays sheets one on the other, from the tool upwards: their offsets.
pub fn lay(stack: &mut [StackSheet]) {
    let mut below = 0.0;
    for sheet in stack {
        sheet.offset = below + 0.5 * sheet.thickness;
        below += sheet.thickness;
    }
}

/// Whether the solver can compute a sheet as the scene has it: its families cross as its material's law has them.
fn check_sheet(sheet: &Sheet, material: &Material) -> Result<()> {
    let degrees = |angle: f64| (1e6 * angle.to_degrees()).round() / 1e6;
    let told = material.crossing();
    match (sheet.kind, sheet.fibres()) {
        (SheetKind::Ply, Some([first, second])) => {
            let crossing = Laid::Straight([first, second]).crossing();
            match crossing {
                // Where the material tells the angle, the rules of scenes hold both against each other.
                Some(crossing) if told.is_none() => Err(FormingError::Scene(format!(
                    "ply '{}': given fibres at {} and {} deg; expected families that cross at a right angle before forming, such as -45 and 45 deg, or a \
                     material whose law knows at which angle they cross: of a `material-fabric`, `with: {{crossing: {} deg}}`. (forming-kinematic drapes \
                     any angles)",
                    sheet.name,
                    degrees(first),
                    degrees(second),
                    degrees(crossing)
                ))),
                _ => Ok(()),
            }
        }
        (SheetKind::Ply, None)
            if told.is_some_and(|t| Laid::Straight([0.0, t]).crossing().is_some()) =>
        {
            Err(FormingError::Scene(format!(
                "ply '{}': given steered fibres, and a material (`{}`) whose families cross at {} deg; expected one whose families cross at a right angle: \
                 the second family of a steered ply lies square to the first one at each place",
                sheet.name,
                material.name,
                degrees(told.unwrap_or_default())
            )))
        }
        _ => Ok(()),
    }
}

/// The blank of a ply before forming.
///
/// # Errors
/// When the scene gives no size, or an outline that is none.
pub fn blank(sheet: &StackSheet) -> Result<Blank> {
    Ok(Blank::new(&sheet.scene)?)
}

/// The part of a ply's blank that mirror planes bound: all of it without planes.
///
/// # Errors
/// As [`blank`].
pub fn blank_part(sheet: &StackSheet, planes: Planes) -> Result<Blank> {
    Ok(blank(sheet)?.part(planes))
}
