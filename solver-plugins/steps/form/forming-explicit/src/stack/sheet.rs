//! The sheets of a scene as they lie one on the other.

use crate::error::{FormingError, Result};
use plyflow_blank::Blank;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::mirror::Planes;
use plyflow_model::material::{Material, MaterialEntry};
use plyflow_model::rules;
use plyflow_model::scene::{Scene, Sheet, SheetKind, first_axis};

/// A sheet of the stack with what the contacts and the output need.
#[derive(Debug, Clone)]
pub struct StackSheet {
    /// The scene's words.
    pub scene: Sheet,
    /// Its material.
    pub material: Material,
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
            check_sheet(sheet)?;
            let MaterialEntry::Inline(material) = &sheet.material else {
                return Err(FormingError::Scene(format!(
                    "the material of sheet '{}' was not read in",
                    sheet.name
                )));
            };
            Ok(StackSheet {
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

/// How far (rad) the angle between the fibre families may be from a right one: rounding of angles that are written in degrees.
const SQUARE: f64 = 1e-6;

/// Whether the solver can compute a sheet as the scene has it.
fn check_sheet(sheet: &Sheet) -> Result<()> {
    if let (SheetKind::Ply, Some(second)) = (sheet.kind, sheet.fibre_2) {
        let degrees = |angle: f64| (1e6 * angle.to_degrees()).round() / 1e6;
        let between = second.si() - sheet.fibre_1.si();
        if between.fixed_cos().abs() > SQUARE {
            return Err(FormingError::Scene(format!(
                "ply '{}': given fibres at {} and {} deg; expected families that cross at a right angle before forming, such as -45 and 45 deg: \
                 elements and material laws of forming-explicit measure shear from there. (forming-kinematic drapes other angles too)",
                sheet.name,
                degrees(sheet.fibre_1.si()),
                degrees(second.si())
            )));
        }
    }
    Ok(())
}

/// Direction of material axis e1 in the undeformed plane.
pub fn axis(sheet: &Sheet) -> Vec3 {
    let first = sheet.fibre_1.si();
    let square = || first + std::f64::consts::FRAC_PI_2;
    let e1 = first_axis(first, sheet.fibre_2.map_or_else(square, |a| a.si()));
    [e1.fixed_cos(), e1.fixed_sin(), 0.0]
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
