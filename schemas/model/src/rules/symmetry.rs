//! Rules of mirror planes: each is named once, and what lies beside it is its own image as far as the scene's words tell. Triangles of a file and
//! the answers of a material are looked at by who has them.

use crate::fault::{Fault, Path, Rule, degrees, mm};
use crate::friction::Friction;
use crate::outline::Millimetres;
use crate::rules::friction::{by_angle, of_class};
use crate::rules::known::Known;
use crate::rules::regions::asymmetric;
use crate::rules::surfaces::Class;
use crate::scene::{Families, MirrorPlane, Sheet};
use crate::tool::rules::is_mirrored;

/// Planes that are named twice.
pub fn repeated(known: &Known<'_>) -> Vec<Fault> {
    let planes = known.symmetry;
    let again = (0..planes.len()).filter(|k| planes[..*k].contains(&planes[*k]));
    again
        .map(|k| {
            let text = format!("the plane `{}` is named twice", planes[k].word());
            Fault::text(Rule::Symmetry, Path::to("symmetry").item(k), text)
                .expected("each of `x` and `y` at most once")
        })
        .collect()
}

/// What is not its own image beside the mirror planes of a scene that is sound without them.
pub fn check(known: &Known<'_>) -> Vec<Fault> {
    if known.symmetry.is_empty() {
        return Vec::new();
    }
    let mut found = fibres(known);
    for (k, plane) in known.symmetry.iter().enumerate() {
        let path = Path::to("symmetry").item(k);
        found.extend(beside(known, *plane).into_iter().map(|text| {
            Fault::text(Rule::Symmetry, path.clone(), text)
                .expected("a scene that is its own mirror image")
                .help(format!("or leave `{}` out of `symmetry`", plane.word()))
        }));
    }
    found
}

/// What is not its own image in a plane.
fn beside(known: &Known<'_>, plane: MirrorPlane) -> Vec<String> {
    let axis = match plane {
        MirrorPlane::X => 0,
        MirrorPlane::Y => 1,
    };
    let word = plane.word();
    let mut found = Vec::new();
    if known.tool.is_some_and(|tool| !is_mirrored(tool, axis)) {
        found.push(format!(
            "the tool is not its own mirror image in the plane {word} = 0"
        ));
    }
    for (_, ply) in known.plies() {
        let region = ply.footprint().ok().flatten();
        if let Some((at, apart)) = region.and_then(|r| r.asymmetry(axis)) {
            found.push(format!(
                "ply `{}`: the blank is not its own mirror image in the plane {word} = 0: the image of its edge at {} lies {} off the edge; move the \
                 blank or change its outline",
                ply.name,
                Millimetres(at),
                mm(apart)
            ));
        }
        if let Some(region) = asymmetric(ply, axis) {
            found.push(format!(
                "region `{}` of ply `{}` has no mirror image in the plane {word} = 0 (a region of the same shape that does the same); move it or \
                 add its image",
                region.name, ply.name
            ));
        }
    }
    found
}

/// What mirror planes do to the fibre families of a sheet.
///
/// # Errors
/// When its fibres lie askew to them.
pub fn families(sheet: &Sheet) -> Result<Families, Fault> {
    sheet.families().ok_or_else(|| {
        let Some([first, _]) = sheet.fibres() else {
            return steered(sheet);
        };
        let text = format!(
            "the fibres of sheet `{}` (fibre_1 at {}) are not their own mirror image",
            sheet.name,
            degrees(first)
        );
        Fault::text(Rule::Symmetry, Path::to("symmetry").item(0), text)
            .expected("fibres along x and y, or at 45 deg to them")
            .help("turn them, or leave out `symmetry`")
    })
}

/// A field of directions would have to be its own image between its points, too, where the triangles of an even grid are not.
fn steered(sheet: &Sheet) -> Fault {
    let text = format!(
        "the fibres of sheet `{}` are steered, and a part of such a ply is not computed beside mirror planes",
        sheet.name
    );
    Fault::text(Rule::Symmetry, Path::to("symmetry").item(0), text)
        .expected("one direction for all of the ply")
        .help("leave out `symmetry`: then the whole is computed")
}

/// Fibres that lie askew to the planes, and friction by the angle to a family that the planes exchange.
fn fibres(known: &Known<'_>) -> Vec<Fault> {
    let depends = known.friction.is_some_and(depends_on_angle)
        || known.plies().any(|(_, ply)| regions_depend_on_angle(ply));
    let of = |sheet: &Sheet| match families(sheet) {
        Err(askew) => Some(askew),
        Ok(Families::Exchanged) if depends => {
            let text = format!(
                "friction depends on the angle to one fibre family (`angle`), which the plane exchanges with the other one in sheet `{}`",
                sheet.name
            );
            let fault = Fault::text(Rule::Symmetry, Path::to("symmetry").item(0), text);
            Some(fault.help("leave out `angle` or `symmetry`, or lay the fibres along x and y"))
        }
        Ok(_) => None,
    };
    known.numbered().filter_map(|(_, s)| of(s)).collect()
}

fn depends_on_angle(friction: &Friction) -> bool {
    let classes = Class::ALL.into_iter();
    let mut classes = classes.filter_map(|class| of_class(friction, class));
    classes.any(|given| by_angle(given).is_some())
        || friction.pairs.iter().any(|p| p.angle.is_some())
}

fn regions_depend_on_angle(ply: &Sheet) -> bool {
    let regions = ply.regions.iter();
    let mut given = regions.flat_map(|r| r.friction.values());
    given.any(|given| by_angle(given).is_some())
}
