//! Regions of plies: which nodes rub otherwise, and which elements have no stitches.

use crate::assembly::{Components, StackSheet};
use crate::elements;
use crate::friction::at_one_bar;
use crate::parameters::{ComponentChoice, Parameters};
use plyflow_mechanics::component::ElementInstance;
use plyflow_mechanics::contact::{FrictionLaw, NodeLaws, Partner, RegionalFriction};
use plyflow_mechanics::mirror::{Planes, reflect};
use plyflow_mechanics::model::Model;
use plyflow_mechanics::sheet::OtherMaterial;
use plyflow_mechanics::vec3::V;
use plyflow_model::artifact::RegionFacts;
use plyflow_model::outline::Point;
use plyflow_model::regions::{PlyRegion, Stitches, area, holds};
use plyflow_model::scene::Sheet;
use std::sync::Arc;

/// A region where it lies over the tool.
pub struct Placed<'a> {
    /// As the scene has it.
    pub region: &'a PlyRegion,
    /// Its corners (m).
    pub corners: Vec<Point>,
}

impl Placed<'_> {
    fn holds(&self, at: V) -> bool {
        holds(&self.corners, [at[0], at[1]])
    }
}

/// The regions of a sheet.
///
/// # Errors
/// When one has no shape ([`plyflow_model::rules::regions`] tells more).
pub fn of_sheet(sheet: &Sheet) -> Result<Vec<Placed<'_>>, String> {
    let centre = sheet.centre.map(|c| c.si());
    let place = |region: &'_ PlyRegion| region.corners(centre);
    let each = sheet.regions.iter().map(|region| {
        let corners = place(region)
            .map_err(|e| format!("region '{}' of '{}' {e}", region.name, sheet.name))?;
        Ok(Placed { region, corners })
    });
    each.collect()
}

/// Numbers of the laws that the nodes of a model's sheet have by their places in the flat ply: that of the first region that holds it, else 0.
pub fn by_node(model: &Model, sheet: &str, regions: &[(Placed<'_>, u16)]) -> NodeLaws {
    let found = model.sheets.iter().find(|s| s.name == sheet);
    let start = model.start();
    let law = |n: u32| {
        let holds = |(r, _): &&(Placed<'_>, u16)| r.holds(start[n as usize]);
        regions.iter().find(holds).map_or(0, |r| r.1)
    };
    NodeLaws::new(found.map_or(&[][..], |s| &s.nodes), law)
}

/// Of the laws of surfaces that could slide under a node of `sheet`, that with the least coefficient under 1 bar, node by node.
pub fn least(model: &Model, sheet: &str, laws: &[FrictionLaw]) -> FrictionLaw {
    let single = |law: &FrictionLaw, node: Option<u32>| -> Vec<FrictionLaw> {
        match law {
            FrictionLaw::Regional(r) => {
                let numbers = node.map_or([0; 2], |n| r.at_node(n));
                let inside: Vec<u16> = numbers.into_iter().filter(|k| *k > 0).collect();
                let numbers = if inside.is_empty() { vec![0] } else { inside };
                numbers
                    .iter()
                    .map(|k| r.laws[usize::from(*k)].clone())
                    .collect()
            }
            law => vec![law.clone()],
        }
    };
    let pick = |node: Option<u32>| {
        let all = laws.iter().flat_map(|l| single(l, node));
        all.reduce(|a, b| {
            if at_one_bar(&b) < at_one_bar(&a) {
                b
            } else {
                a
            }
        })
    };
    let same = |a: &FrictionLaw, b: &FrictionLaw| match (a, b) {
        (FrictionLaw::Constant(a), FrictionLaw::Constant(b)) => a.to_bits() == b.to_bits(),
        (FrictionLaw::Varying(a), FrictionLaw::Varying(b)) => Arc::ptr_eq(a, b),
        _ => false,
    };
    let mut list: Vec<FrictionLaw> = pick(None).into_iter().collect();
    let nodes = model.sheets.iter().find(|s| s.name == sheet);
    let nodes = nodes.map_or(&[][..], |s| &s.nodes);
    let mut numbers = std::collections::BTreeMap::new();
    for n in nodes {
        let Some(law) = pick(Some(*n)) else { continue };
        let known = list.iter().position(|l| same(l, &law));
        let k = known.unwrap_or_else(|| {
            list.push(law);
            list.len() - 1
        });
        numbers.insert(*n, k as u16);
    }
    FrictionLaw::Regional(Arc::new(RegionalFriction {
        laws: list,
        slave: NodeLaws::new(nodes, |n| numbers.get(&n).copied().unwrap_or(0)),
        partner: Partner::Bare,
    }))
}

/// Middle of a cell (m).
fn centre(points: &[V], cell: &[u32; 4]) -> V {
    let corners = cell.map(|n| points[n as usize]);
    [0, 1, 2].map(|k| 0.25 * corners.iter().map(|x| x[k]).sum::<f64>())
}

/// The material without stitches of a ply in `element`, with the cells (of these points in the flat ply) that have it: those whose middles lie in a region
/// that removes them. `None` of a ply without such cells.
///
/// # Errors
/// The component's own text.
pub fn unstitched(
    components: &dyn Components,
    sheet: &StackSheet,
    (points, cells): (&[V], &[[u32; 4]]),
    element: &ElementInstance,
    p: &Parameters,
) -> Result<Option<OtherMaterial>, String> {
    let all = of_sheet(&sheet.scene)?;
    let removed = |at: V| {
        let mut without = all
            .iter()
            .filter(|r| r.region.stitches == Some(Stitches::Removed));
        without.any(|r| r.holds(at))
    };
    let cells: Vec<bool> = cells.iter().map(|c| removed(centre(points, c))).collect();
    if !cells.iter().any(|c| *c) {
        return Ok(None);
    }
    let mut bare = sheet.clone();
    bare.material.with.remove("stitch");
    let make = |choice: &ComponentChoice| elements::element(components, &bare, choice);
    let other = make(&p.element)?;
    debug_assert_eq!(other.sizes.fields, element.sizes.fields);
    Ok(Some(OtherMaterial {
        element: other,
        elsewhere: p.element_elsewhere.as_ref().map(make).transpose()?,
        cells,
    }))
}

/// Whether the regions of a ply lie on what is computed of it as the scene means them: each holds a node, or the middle of an element where it removes
/// stitches.
///
/// # Errors
/// A text for the user.
pub fn check(
    sheet: &Sheet,
    points: &[V],
    cells: &[[u32; 4]],
    planes: Planes,
) -> Result<(), String> {
    for placed in of_sheet(sheet)? {
        let images = planes.images();
        let seen = |at: V| images.iter().any(|i| placed.holds(reflect(at, *i)));
        let (region, name) = (&placed.region.name, &sheet.name);
        if !placed.region.friction.is_empty() && !points.iter().any(|p| seen(*p)) {
            return Err(format!(
                "region '{region}' of ply '{name}' holds no node, so its friction would act nowhere; expected a larger region or a smaller `element_size`"
            ));
        }
        if placed.region.stitches.is_some() && !cells.iter().any(|c| seen(centre(points, c))) {
            return Err(format!(
                "region '{region}' of ply '{name}' holds the middle of no element, so its stitches would be removed nowhere; expected a larger region or a smaller \
                 `element_size`"
            ));
        }
    }
    Ok(())
}

/// What the artifact tells of the regions of a sheet.
pub fn attributes(sheet: &Sheet) -> Vec<RegionFacts> {
    let of = |placed: &Placed<'_>| RegionFacts {
        name: placed.region.name.clone(),
        outline: placed.corners.clone(),
        area: area(&placed.corners),
        friction: placed.region.friction.keys().cloned().collect(),
        stitches: placed.region.stitches,
    };
    of_sheet(sheet).map_or_else(|_| Vec::new(), |all| all.iter().map(of).collect())
}
