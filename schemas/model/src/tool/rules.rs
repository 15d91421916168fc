//! What a tool must be to have a surface, and whether it is its own mirror image: as far as its words tell. What only triangles show is left to
//! who has them.

use crate::budget::{self, MOST_FACETS, Wanted};
use crate::fault::{Fault, Path, Rule, mm};
use crate::tool::shape::{JoggleShape, SparShape};
use crate::tool::spar::positive;
use crate::tool::{DoubleDomeTool, HemisphereTool, TetrahedronTool, Tool};
use plyflow_fixed::FixedBits;

/// Whether a tool can be built. Files, and what other steps make, are looked at where they are read.
///
/// # Errors
/// The first thing that keeps it from having a surface.
pub fn check(tool: &Tool) -> Result<(), Fault> {
    let at = Path::to("tool").key(word(tool));
    match tool {
        Tool::JoggleSpar(spar) => spar.shape().map(drop),
        Tool::RampedSpar(spar) => spar.shape().map(drop),
        Tool::Flat(flat) => flat.shape().map(drop),
        Tool::Hemisphere(t) => hemisphere(t, &at),
        Tool::DoubleDome(t) => double_dome(t, &at),
        Tool::Tetrahedron(t) => tetrahedron(t, &at),
        Tool::Stl(stl) => {
            positive(at.key("unit"), stl.unit.si()).and_then(|()| stl.place().check(&at))
        }
        Tool::Input(input) => input.place().check(&at),
    }?;
    few_facets(tool, &at)
}

/// The word for it in a scene file.
fn word(tool: &Tool) -> &'static str {
    match tool {
        Tool::JoggleSpar(_) => "joggle_spar",
        Tool::Flat(_) => "flat",
        Tool::RampedSpar(_) => "ramped_spar",
        Tool::Hemisphere(_) => "hemisphere",
        Tool::DoubleDome(_) => "double_dome",
        Tool::Tetrahedron(_) => "tetrahedron",
        Tool::Stl(_) => "stl",
        Tool::Input(_) => "input",
    }
}

fn hemisphere(t: &HemisphereTool, at: &Path) -> Result<(), Fault> {
    let (radius, facet) = (t.radius.si(), t.facet_size.si());
    positive(at.key("radius"), radius)?;
    positive(at.key("facet_size"), facet)?;
    if facet <= radius {
        return Ok(());
    }
    Err(Fault::given(Rule::Tool, at.key("facet_size"), mm(facet))
        .expected(format!("at most `radius` ({})", mm(radius)))
        .help("take smaller facets"))
}

fn double_dome(t: &DoubleDomeTool, at: &Path) -> Result<(), Fault> {
    let (radius, distance) = (t.dome_radius.si(), t.dome_distance.si());
    let (waist, wall) = (t.waist_radius.si(), t.wall.si());
    for (name, value) in [
        ("dome_radius", radius),
        ("dome_distance", distance),
        ("waist_radius", waist),
        ("facet_size", t.facet_size.si()),
    ] {
        positive(at.key(name), value)?;
    }
    if !(wall >= 0.0 && wall.is_finite()) {
        return Err(Fault::given(Rule::Tool, at.key("wall"), mm(wall))
            .expected("at least 0 mm")
            .help("give a length, or leave it out"));
    }
    let centre = 0.5 * distance;
    // Where the waist's arc would reach the axis: (R + w)^2 = c^2 + w^2.
    let least = (centre * centre - radius * radius) / (2.0 * radius);
    if waist > least {
        return Ok(());
    }
    Err(Fault::given(Rule::Tool, at.key("waist_radius"), mm(waist))
        .expected(format!("more than {}, or the domes do not meet", mm(least)))
        .help("take a larger waist radius or bring the domes together"))
}

fn tetrahedron(t: &TetrahedronTool, at: &Path) -> Result<(), Fault> {
    let (edge, height, radius) = (t.edge.si(), t.height.si(), t.radius.si());
    for (name, value) in [
        ("edge", edge),
        ("height", height),
        ("radius", radius),
        ("facet_size", t.facet_size.si()),
    ] {
        positive(at.key(name), value)?;
    }
    // The sphere of the top may sink to the bed, not below: its centre lies at height - radius / n, with n the rise of a face's normal. A
    // face stands on the triangle's inscribed circle.
    let circle = edge / (2.0 * 3f64.sqrt());
    let largest = height * circle / circle.fixed_hypot(height);
    if radius < largest {
        return Ok(());
    }
    Err(Fault::given(Rule::Tool, at.key("radius"), mm(radius))
        .expected(format!("less than {}", mm(largest)))
        .help("take a smaller radius or a higher tool"))
}

/// Whether a tool that is made from parameters has not too many facets to be made. Files and what other steps make have the
/// facets that they have.
fn few_facets(tool: &Tool, at: &Path) -> Result<(), Fault> {
    let Some((plan, facet)) = plan_and_facet(tool) else {
        return Ok(());
    };
    let wanted = Wanted {
        what: "the tool's surface",
        of: "facets",
        // Two facets for each square of that side, on top and below.
        count: 4.0 * plan / (facet * facet),
        most: MOST_FACETS,
        bytes: budget::FACET_BYTES,
        parameter: "facet_size",
        size: facet,
    };
    budget::allow(wanted).map_err(|e| Fault::text(Rule::Tool, at.key("facet_size"), e.to_string()))
}

/// Area in plan (m2) and largest edge of a facet (m) of a tool that is made from parameters, before any is made.
pub fn plan_and_facet(tool: &Tool) -> Option<(f64, f64)> {
    let circle = |r: f64| std::f64::consts::PI * r * r;
    Some(match tool {
        Tool::JoggleSpar(s) => (s.length.si() * s.top_width.si(), s.facet_size.si()),
        Tool::RampedSpar(s) => (s.length.si() * s.top_width.si(), s.facet_size.si()),
        Tool::Flat(f) => (f.length.si() * f.width.si(), f.facet_size.si()),
        Tool::Tetrahedron(t) => (0.25 * 3f64.sqrt() * t.edge.si().powi(2), t.facet_size.si()),
        Tool::DoubleDome(d) => (circle(d.dome_radius.si()), d.facet_size.si()),
        Tool::Hemisphere(h) => (circle(h.radius.si()), h.facet_size.si()),
        Tool::Stl(_) | Tool::Input(_) => return None,
    })
}

/// Whether a tool that can be built is its own mirror image in the plane x = 0 (`axis` 0) or y = 0 (1). Of a file, and of what another step
/// makes, nothing is known here.
pub fn is_mirrored(tool: &Tool, axis: usize) -> bool {
    match tool {
        Tool::JoggleSpar(spar) => spar.shape().is_ok_and(|s| spar_is_mirrored(&s, axis)),
        Tool::Tetrahedron(_) => axis == 0,
        Tool::Flat(_)
        | Tool::RampedSpar(_)
        | Tool::Hemisphere(_)
        | Tool::DoubleDome(_)
        | Tool::Stl(_)
        | Tool::Input(_) => true,
    }
}

/// Lengths (m) and angles (rad) that differ by less are the same: what decimals of a scene leave.
const SAME: f64 = 1e-5;

fn spar_is_mirrored(shape: &SparShape, axis: usize) -> bool {
    let image = |j: &JoggleShape| match axis {
        // Up one way is down the other.
        0 => (
            [-(j.start + j.length), j.length, -j.skew, j.fillet],
            [-j.rise, -j.sides[0], -j.sides[1]],
        ),
        _ => (
            [j.start, j.length, -j.skew, j.fillet],
            [j.rise, j.sides[1], j.sides[0]],
        ),
    };
    let does = |j: &&JoggleShape| JoggleShape::amplitude(j.rise, j.sides) > 0.0;
    let same = |a: f64, b: f64| (a - b).abs() < SAME;
    shape.joggles.iter().filter(does).all(|j| {
        let (lies, moves) = image(j);
        shape.joggles.iter().any(|o| {
            let own = (
                [o.start, o.length, o.skew, o.fillet],
                [o.rise, o.sides[0], o.sides[1]],
            );
            (0..4).all(|k| same(lies[k], own.0[k])) && (0..3).all(|k| same(moves[k], own.1[k]))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn tool(tool: Value) -> Tool {
        serde_json::from_value(tool).unwrap_or_else(|e| panic!("{e}"))
    }

    fn spar(joggles: &[(i32, i32, i32)]) -> Tool {
        let joggle = |(start, rise, skew): &(i32, i32, i32)| {
            json!({"start": format!("{start} mm"), "length": "60 mm", "rise": format!("{rise} mm"), "skew": format!("{skew} deg"),
                "side_step": ["0 mm", "0 mm"], "fillet": "12 mm"})
        };
        let joggles: Vec<Value> = joggles.iter().map(joggle).collect();
        tool(
            json!({"joggle_spar": {"length": "600 mm", "top_width": "120 mm", "height": "60 mm", "draft": "10 deg", "fillet": "10 mm",
            "joggles": joggles, "facet_size": "4 mm"}}),
        )
    }

    #[test]
    fn a_spar_is_its_own_image_along_x_when_its_joggles_mirror_each_other_and_along_y_when_none_is_slanted()
     {
        for (joggles, wanted) in [
            (&[][..], [true, true]),
            (&[(-160, -10, 0), (100, 10, 0)], [true, true]),
            (&[(-160, -10, 0), (100, -10, 0)], [false, true]),
            (&[(-160, -10, 0), (90, 10, 0)], [false, true]),
            (&[(-160, -10, 8), (100, 10, -8)], [true, false]),
            (&[(-160, -10, 8), (100, 10, 8)], [false, false]),
        ] {
            let spar = spar(joggles);
            check(&spar).unwrap_or_else(|e| panic!("{joggles:?}: {e}"));
            assert_eq!([0, 1].map(|k| is_mirrored(&spar, k)), wanted, "{joggles:?}");
        }
    }

    #[test]
    fn what_bounds_no_solid_is_refused_with_the_place_and_the_bound() {
        for (given, says) in [
            (
                json!({"hemisphere": {"radius": "-50 mm", "facet_size": "4 mm"}}),
                "tool.hemisphere.radius: given -50 mm; expected more than 0 mm",
            ),
            (
                json!({"hemisphere": {"radius": "50 mm", "facet_size": "60 mm"}}),
                "tool.hemisphere.facet_size: given 60 mm; expected at most `radius` (50 mm)",
            ),
            (
                json!({"double_dome": {"dome_radius": "20 mm", "dome_distance": "180 mm", "waist_radius": "150 mm", "facet_size": "4 mm"}}),
                "waist_radius: given 150 mm; expected more than 192.5 mm",
            ),
            (
                json!({"tetrahedron": {"edge": "200 mm", "height": "160 mm", "radius": "60 mm", "facet_size": "4 mm"}}),
                "tool.tetrahedron.radius: given 60 mm; expected less than 54.308 mm",
            ),
            (
                json!({"flat": {"length": "100 mm", "width": "20 mm", "height": "20 mm", "fillet": "6 mm", "facet_size": "4 mm"}}),
                "tool.flat.fillet: given 6 mm; expected less than a quarter of the smaller side, 5 mm",
            ),
            (
                json!({"hemisphere": {"radius": "50 mm", "facet_size": "0.001 mm"}}),
                "facets at `facet_size`",
            ),
            (
                json!({"ramped_spar": {"length": "600 mm", "top_width": "120 mm", "height": "60 mm", "draft": "5 deg", "fillet": "10 mm",
                    "recess": "400 mm", "ramp": "180 mm", "depth": "10 mm", "side_depth": "5 mm", "facet_size": "4 mm"}}),
                "tool.ramped_spar.recess: given 400 mm",
            ),
        ] {
            let text = check(&tool(given)).unwrap_err().to_string();
            assert!(text.contains(says), "{says}\n{text}");
        }
    }
}
