//! Regions of plies: which nodes rub otherwise, and which elements have no stitches.

use crate::error::{FormingError, Result};
use crate::stack::place::SheetIndex;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::contact::NodeLaws;
use plyflow_mechanics::mirror::{Planes, reflect};
use plyflow_mechanics::model::Model;
use plyflow_model::artifact::RegionFacts;
use plyflow_model::outline::Point;
use plyflow_model::regions::{PlyRegion, Stitches, area, holds};
use plyflow_model::scene::Sheet;

/// A region where it lies over the tool.
pub struct PlacedRegion<'a> {
    /// As the scene has it.
    pub region: &'a PlyRegion,
    /// Its corners (m).
    pub corners: Vec<Point>,
}

impl PlacedRegion<'_> {
    fn holds(&self, at: Vec3) -> bool {
        holds(&self.corners, [at[0], at[1]])
    }
}

/// The regions of a sheet.
///
/// # Errors
/// When one has no shape ([`plyflow_model::rules::regions`] tells more).
pub fn of_sheet(sheet: &Sheet) -> Result<Vec<PlacedRegion<'_>>> {
    let centre = sheet.centre.map(|c| c.si());
    let place = |region: &'_ PlyRegion| region.corners(centre);
    let each = sheet.regions.iter().map(|region| {
        let corners = place(region).map_err(|e| {
            FormingError::Scene(format!("region '{}' of '{}' {e}", region.name, sheet.name))
        })?;
        Ok(PlacedRegion { region, corners })
    });
    each.collect()
}

/// Numbers of the laws that the nodes of a model's sheet have by their places in the flat ply: that of the first region that holds it, else 0.
pub fn by_node(model: &Model, sheet: &str, regions: &[(PlacedRegion<'_>, u16)]) -> NodeLaws {
    let start = model.start();
    let law = |n: u32| {
        let holds = |(r, _): &&(PlacedRegion<'_>, u16)| r.holds(start[n as usize]);
        regions.iter().find(holds).map_or(0, |r| r.1)
    };
    NodeLaws::new(nodes_of(model, sheet), law)
}

/// Nodes of the sheet of that name; none where the model has no such sheet.
pub fn nodes_of<'m>(model: &'m Model, sheet: &str) -> &'m [u32] {
    SheetIndex::named(model, sheet).map_or(&[], |s| s.nodes(model))
}

/// Middle of a cell (m).
pub fn centre(points: &[Vec3], cell: &[u32; 4]) -> Vec3 {
    let corners = cell.map(|n| points[n as usize]);
    [0, 1, 2].map(|k| 0.25 * corners.iter().map(|x| x[k]).sum::<f64>())
}

/// Of the cells of a flat ply with these points, which have no stitches: those whose middles lie in a region that removes them.
///
/// # Errors
/// As [`of_sheet`].
pub fn without_stitches(sheet: &Sheet, points: &[Vec3], cells: &[[u32; 4]]) -> Result<Vec<bool>> {
    let mut all = of_sheet(sheet)?;
    all.retain(|r| r.region.stitches == Some(Stitches::Removed));
    let removed = |at: Vec3| all.iter().any(|r| r.holds(at));
    Ok(cells.iter().map(|c| removed(centre(points, c))).collect())
}

/// Whether the regions of a ply lie on what is computed of it as the scene means them: each holds a node, or the middle of an element where it
/// removes stitches.
pub fn check(sheet: &Sheet, points: &[Vec3], cells: &[[u32; 4]], planes: Planes) -> Result<()> {
    for placed in of_sheet(sheet)? {
        let images = planes.images();
        let seen = |at: Vec3| images.iter().any(|i| placed.holds(reflect(at, *i)));
        let (region, name) = (&placed.region.name, &sheet.name);
        if !placed.region.friction.is_empty() && !points.iter().any(|p| seen(*p)) {
            return Err(FormingError::Scene(format!(
                "region '{region}' of ply '{name}' holds no node, so its friction would act nowhere; expected a larger region or a smaller `element_size`"
            )));
        }
        if placed.region.stitches.is_some() && !cells.iter().any(|c| seen(centre(points, c))) {
            return Err(FormingError::Scene(format!(
                "region '{region}' of ply '{name}' holds the middle of no element, so its stitches would be removed nowhere; expected a larger region or a smaller \
                 `element_size`"
            )));
        }
    }
    Ok(())
}

/// What the artifact tells of the regions of a sheet.
pub fn attributes(sheet: &Sheet) -> Vec<RegionFacts> {
    let of = |placed: &PlacedRegion<'_>| RegionFacts {
        name: placed.region.name.clone(),
        outline: placed.corners.clone(),
        area: area(&placed.corners),
        friction: placed.region.friction.keys().cloned().collect(),
        stitches: placed.region.stitches,
    };
    of_sheet(sheet).map_or_else(|_| Vec::new(), |all| all.iter().map(of).collect())
}
