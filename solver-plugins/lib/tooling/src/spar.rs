//! The joggle spar and the flat block: checks of their parameters, and their sweeps.

use crate::CHORD_TOLERANCE;
use crate::error::{ToolError, mm};
use crate::mesh::ToolMesh;
use crate::ramp::Ramp;
use crate::sweep::{JoggleShape, Sweep};
use plyflow_fixed::FixedBits;
use plyflow_model::scene::{FlatTool, Joggle, JoggleSpar, RampedSpar};
use plyflow_model::units::{Angle, Length};

const SPAR: &str = "joggle_spar";
const FLAT: &str = "flat";
const RAMPED: &str = "ramped_spar";

/// The spar's closed surface, standing on z = 0.
pub(crate) fn joggle_spar(spar: &JoggleSpar) -> Result<ToolMesh, ToolError> {
    positive(SPAR, "facet_size", spar.facet_size.si())?;
    Ok(spar_sweep(spar)?.mesh(spar.facet_size.si(), CHORD_TOLERANCE))
}

/// The ramped spar's closed surface, standing on z = 0: a joggle down, and one up again.
pub(crate) fn ramped_spar(spar: &RampedSpar) -> Result<ToolMesh, ToolError> {
    for (name, value) in [
        ("recess", spar.recess.si()),
        ("depth", spar.depth.si()),
        ("side_depth", spar.side_depth.si()),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            let expected = "it must be at least 0 mm".into();
            return Err(ToolError::length(
                RAMPED,
                name,
                value,
                expected,
                "give a length",
            ));
        }
    }
    let half = 0.5 * spar.recess.si();
    let ramp = |start: f64, way: f64| Joggle {
        start: Length(start),
        length: spar.ramp,
        rise: Length(way * spar.depth.si()),
        skew: Angle(0.0),
        side_step: [Length(way * spar.side_depth.si()); 2],
        fillet: spar.fillet,
    };
    let joggled = JoggleSpar {
        length: spar.length,
        top_width: spar.top_width,
        height: spar.height,
        draft: spar.draft,
        fillet: spar.fillet,
        corner: None,
        joggles: vec![ramp(-half - spar.ramp.si(), -1.0), ramp(half, 1.0)],
        facet_size: spar.facet_size,
    };
    joggle_spar(&joggled).map_err(|e| ramped(spar, e))
}

/// What is wrong with the joggles that stand for the ramps, in the words of the ramped spar.
fn ramped(spar: &RampedSpar, e: ToolError) -> ToolError {
    let ToolError::Parameter {
        parameter,
        given,
        expected,
        remedy,
        ..
    } = e
    else {
        return e;
    };
    match parameter.strip_prefix("joggles").map(|p| &p[4..]) {
        Some("start") => ToolError::length(
            RAMPED,
            "recess",
            spar.recess.si(),
            format!(
                "with its two ramps of {} it must fit between the rounded ends",
                mm(spar.ramp.si())
            ),
            "lengthen the spar, or shorten recess or ramps",
        ),
        Some(field) => ToolError::Parameter {
            tool: RAMPED,
            parameter: if field == "length" { "ramp" } else { field }.into(),
            given,
            expected,
            remedy,
        },
        None => ToolError::Parameter {
            tool: RAMPED,
            parameter,
            given,
            expected,
            remedy,
        },
    }
}

/// The block's closed surface, standing on z = 0.
pub(crate) fn flat(flat: &FlatTool) -> Result<ToolMesh, ToolError> {
    let (length, width) = (flat.length.si(), flat.width.si());
    let (height, fillet) = (flat.height.si(), flat.fillet.si());
    for (name, value) in [
        ("length", length),
        ("width", width),
        ("height", height),
        ("fillet", fillet),
    ] {
        positive(FLAT, name, value)?;
    }
    positive(FLAT, "facet_size", flat.facet_size.si())?;
    if fillet > height {
        return Err(ToolError::length(
            FLAT,
            "fillet",
            fillet,
            format!("it must be at most the height, {}", mm(height)),
            "raise the height or take a smaller fillet",
        ));
    }
    // The vertical edges are rounded by twice the fillet, so that the fillet's inner outline is round too.
    let corner = 2.0 * fillet;
    let half = 0.5 * length.min(width);
    if corner >= half {
        return Err(ToolError::length(
            FLAT,
            "fillet",
            fillet,
            format!(
                "it must be less than a quarter of the smaller side, {}",
                mm(0.5 * half)
            ),
            "take a smaller fillet or a larger block",
        ));
    }
    let sweep = Sweep {
        ends: [-0.5 * length, 0.5 * length],
        half_width: 0.5 * width,
        height,
        draft: 0.0,
        fillet,
        corner,
        joggles: Vec::new(),
    };
    Ok(sweep.mesh(flat.facet_size.si(), CHORD_TOLERANCE))
}

/// The spar's parameters as a sweep, checked.
pub(crate) fn spar_sweep(spar: &JoggleSpar) -> Result<Sweep, ToolError> {
    for (name, value) in [
        ("length", spar.length.si()),
        ("top_width", spar.top_width.si()),
        ("height", spar.height.si()),
        ("fillet", spar.fillet.si()),
    ] {
        positive(SPAR, name, value)?;
    }
    let draft = spar.draft.si();
    if !(0.0..=1.0).contains(&draft) {
        return Err(ToolError::Parameter {
            tool: SPAR,
            parameter: "draft".into(),
            given: format!("{:.2} deg", draft.to_degrees()),
            expected: "it must lie between 0 deg and 57 deg".into(),
            remedy: "give the angle of the side walls from the vertical".into(),
        });
    }
    let joggles = spar
        .joggles
        .iter()
        .enumerate()
        .map(|(i, j)| joggle(i, j))
        .collect::<Result<Vec<_>, _>>()?;
    // Along a ramp the edge climbs, and the section square to it is an ellipse, sharper than the circle in the
    // plane x = constant; the circle is enlarged so that the stated radius holds there.
    let enlarge = joggles
        .iter()
        .map(JoggleShape::sharpening)
        .fold(1.0, f64::max);
    let mut sweep = Sweep {
        ends: [0.0; 2],
        half_width: 0.5 * spar.top_width.si(),
        height: spar.height.si(),
        draft,
        fillet: spar.fillet.si() * enlarge,
        corner: 0.0,
        joggles,
    };
    sweep.corner = spar.corner.map_or(2.0 * sweep.fillet, |c| c.si());
    // `length` is that of the foot on the bed.
    let half = 0.5 * spar.length.si();
    let end_height = sweep.height + sweep.lift(half, 0.0);
    sweep.ends = [
        -half + sweep.height * draft.fixed_tan(),
        half - end_height * draft.fixed_tan(),
    ];
    check_fit(spar, &sweep)?;
    Ok(sweep)
}

fn joggle(i: usize, j: &Joggle) -> Result<JoggleShape, ToolError> {
    let name = |field: &str| format!("joggles[{i}].{field}");
    let (length, radius, skew) = (j.length.si(), j.fillet.si(), j.skew.si());
    positive(SPAR, &name("length"), length)?;
    positive(SPAR, &name("fillet"), radius)?;
    if skew.is_nan() || skew.abs() > 0.8 {
        return Err(ToolError::Parameter {
            tool: SPAR,
            parameter: name("skew"),
            given: format!("{:.2} deg", skew.to_degrees()),
            expected: "it must lie between -45 deg and 45 deg".into(),
            remedy: "give the slant of the ramp in plan".into(),
        });
    }
    let (rise, sides) = (j.rise.si(), j.side_step.map(|s| s.si()));
    let amplitude = JoggleShape::amplitude(rise, sides);
    let profile = Ramp::new(length * skew.fixed_cos(), amplitude, radius).ok_or_else(|| {
        ToolError::length(
            SPAR,
            name("length"),
            length,
            format!(
                "its fillets of {} with the rise of {} and the side step need at least {}",
                mm(radius),
                mm(rise),
                mm(Ramp::shortest(amplitude, radius) / skew.fixed_cos())
            ),
            "make the ramp longer or its fillets smaller",
        )
    })?;
    Ok(JoggleShape {
        start: j.start.si(),
        length,
        skew,
        profile,
        rise,
        sides,
        fillet: radius,
    })
}

/// The level top must remain and the fillets must end above the bed.
fn check_fit(spar: &JoggleSpar, sweep: &Sweep) -> Result<(), ToolError> {
    let setback = sweep.setback();
    let [from, to] = sweep.ends;
    if to - from < 2.1 * sweep.corner {
        return Err(ToolError::length(
            SPAR,
            "length",
            spar.length.si(),
            format!(
                "it must exceed {}: two rounded ends of {} and what the end walls lean in",
                mm(spar.length.si() + 2.1 * sweep.corner - (to - from)),
                mm(sweep.corner)
            ),
            "lengthen the spar, or take smaller `fillet`, `corner` and `draft`",
        ));
    }
    if sweep.half_width <= sweep.corner.max(setback) * 1.05 {
        return Err(ToolError::length(
            SPAR,
            "top_width",
            spar.top_width.si(),
            format!("it must exceed {}", mm(2.1 * sweep.corner.max(setback))),
            "widen the top, or take smaller `fillet` and `corner`",
        ));
    }
    if sweep.corner < 1.1 * setback {
        return Err(ToolError::length(
            SPAR,
            "corner",
            sweep.corner,
            format!(
                "a fillet of {} needs at least {}",
                mm(spar.fillet.si()),
                mm(1.1 * setback)
            ),
            "round the vertical edges at the ends more",
        ));
    }
    let lowest = lowest_top(sweep);
    let drop = sweep.fillet * (1.0 - sweep.arc_angle().fixed_cos());
    if lowest <= drop {
        return Err(ToolError::length(
            SPAR,
            "height",
            spar.height.si(),
            format!(
                "the top, {} at its lowest, must be higher than its fillet, {}",
                mm(lowest),
                mm(drop)
            ),
            "raise the tool or take a smaller fillet",
        ));
    }
    check_places(sweep, lowest)
}

/// Joggles must lie between the rounded ends, one after the other.
fn check_places(sweep: &Sweep, lowest: f64) -> Result<(), ToolError> {
    let tallest = sweep.height + (lowest - sweep.height).abs() + total_rise(sweep);
    let foot = sweep.half_width + tallest * sweep.draft.fixed_tan();
    let [low, high] = [sweep.ends[0] + sweep.corner, sweep.ends[1] - sweep.corner];
    let mut reached = (low, "the rounded end at".to_owned());
    for (i, j) in sweep.joggles.iter().enumerate() {
        // Joggles may slant across each other's x range, but must not meet at any y.
        let slant = if i == 0 {
            foot * j.skew.fixed_tan().abs()
        } else {
            0.0
        };
        let previous = i.checked_sub(1).map(|k| &sweep.joggles[k]);
        let lean = previous.map_or(0.0, |p| {
            foot * (p.skew.fixed_tan() - j.skew.fixed_tan()).abs()
        });
        let begin = j.start - slant - lean;
        if begin < reached.0 {
            return Err(ToolError::length(
                SPAR,
                format!("joggles[{i}].start"),
                j.start,
                format!(
                    "with its slant it begins at {}, before {} {}",
                    mm(begin),
                    reached.1,
                    mm(reached.0)
                ),
                "move the joggle, lengthen the tool or reduce `skew`",
            ));
        }
        reached = (j.start + j.length, format!("the end of joggles[{i}] at"));
    }
    for (i, j) in sweep.joggles.iter().enumerate() {
        let end = j.start + j.length + foot * j.skew.fixed_tan().abs();
        if end > high {
            return Err(ToolError::length(
                SPAR,
                format!("joggles[{i}].start"),
                j.start,
                format!(
                    "with length and slant it ends at {}, beyond the rounded end at {}",
                    mm(end),
                    mm(high)
                ),
                "move the joggle, lengthen the tool or reduce `skew`",
            ));
        }
    }
    Ok(())
}

fn total_rise(sweep: &Sweep) -> f64 {
    sweep.joggles.iter().map(|j| j.rise.max(0.0)).sum()
}

/// Height of the top where it is lowest.
fn lowest_top(sweep: &Sweep) -> f64 {
    let mut height = sweep.height;
    let mut lowest = height;
    for j in &sweep.joggles {
        height += j.rise;
        lowest = lowest.min(height);
    }
    lowest
}

impl JoggleShape {
    /// Factor by which the fillet's circle must be larger than the radius that must remain.
    fn sharpening(&self) -> f64 {
        1.0 + self.profile.slope().powi(2)
    }
}

fn positive(tool: &'static str, name: &str, value: f64) -> Result<(), ToolError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(ToolError::length(
        tool,
        name,
        value,
        "it must be greater than 0 mm".into(),
        "give a positive length",
    ))
}

#[cfg(test)]
pub(crate) mod tests;
