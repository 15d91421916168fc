//! Swept tools: what their parameters say, checked, as a shape.

use crate::fault::{Fault, Path, Rule, degrees, mm};
use crate::tool::ramp::Ramp;
use crate::tool::shape::{JoggleShape, SparShape};
use crate::tool::{FlatTool, Joggle, JoggleSpar, RampedSpar};
use crate::units::{Angle, Length};
use plyflow_fixed::FixedBits;

/// Largest angle of walls from the vertical (deg).
const MOST_DRAFT: f64 = 57.0;
/// Largest slant of a ramp in plan (deg).
const MOST_SKEW: f64 = 45.0;

/// A length out of its bounds.
fn wrong(path: Path, length: f64, expected: String, help: &str) -> Fault {
    Fault::given(Rule::Tool, path, mm(length))
        .expected(expected)
        .help(help)
}

/// Whether a length is one.
///
/// # Errors
/// When it is not more than 0.
pub fn positive(path: Path, length: f64) -> Result<(), Fault> {
    if length > 0.0 && length.is_finite() {
        return Ok(());
    }
    Err(wrong(
        path,
        length,
        "more than 0 mm".into(),
        "give a positive length",
    ))
}

fn at_most(path: Path, length: f64, most: f64, name: &str) -> Result<(), Fault> {
    if length <= most {
        return Ok(());
    }
    Err(wrong(
        path,
        length,
        format!("at most {name} ({})", mm(most)),
        "take a smaller fillet or a larger tool",
    ))
}

impl FlatTool {
    /// Its shape.
    ///
    /// # Errors
    /// What of it bounds no block.
    pub fn shape(&self) -> Result<SparShape, Fault> {
        let at = Path::to("tool").key("flat");
        let (length, width) = (self.length.si(), self.width.si());
        let (height, fillet) = (self.height.si(), self.fillet.si());
        for (name, value) in [
            ("length", length),
            ("width", width),
            ("height", height),
            ("fillet", fillet),
            ("facet_size", self.facet_size.si()),
        ] {
            positive(at.key(name), value)?;
        }
        at_most(at.key("fillet"), fillet, height, "`height`")?;
        // The vertical edges are rounded by twice the fillet, so that the fillet's inner outline is round too.
        let corner = 2.0 * fillet;
        let half = 0.5 * length.min(width);
        if corner >= half {
            return Err(wrong(
                at.key("fillet"),
                fillet,
                format!(
                    "less than a quarter of the smaller side, {}",
                    mm(0.5 * half)
                ),
                "take a smaller fillet or a larger block",
            ));
        }
        Ok(SparShape {
            ends: [-0.5 * length, 0.5 * length],
            half_width: 0.5 * width,
            height,
            draft: 0.0,
            fillet,
            corner,
            joggles: Vec::new(),
        })
    }
}

impl RampedSpar {
    /// Its shape: a joggle down, and one up again.
    ///
    /// # Errors
    /// What of it bounds no spar.
    pub fn shape(&self) -> Result<SparShape, Fault> {
        let at = Path::to("tool").key("ramped_spar");
        for (name, value) in [
            ("recess", self.recess.si()),
            ("depth", self.depth.si()),
            ("side_depth", self.side_depth.si()),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                let expected = "at least 0 mm".into();
                return Err(wrong(at.key(name), value, expected, "give a length"));
            }
        }
        let half = 0.5 * self.recess.si();
        let ramp = |start: f64, way: f64| Joggle {
            start: Length(start),
            length: self.ramp,
            rise: Length(way * self.depth.si()),
            skew: Angle(0.0),
            side_step: [Length(way * self.side_depth.si()); 2],
            fillet: self.fillet,
        };
        let joggled = JoggleSpar {
            length: self.length,
            top_width: self.top_width,
            height: self.height,
            draft: self.draft,
            fillet: self.fillet,
            corner: None,
            joggles: vec![ramp(-half - self.ramp.si(), -1.0), ramp(half, 1.0)],
            facet_size: self.facet_size,
        };
        swept(&joggled, &at).map_err(|fault| self.in_own_words(&at, fault))
    }

    /// What is wrong with the joggles that stand for the ramps.
    fn in_own_words(&self, at: &Path, fault: Fault) -> Fault {
        let of_joggle = fault.path.to_string().contains("joggles");
        match (of_joggle, fault.path.last_key()) {
            (true, "start") => wrong(
                at.key("recess"),
                self.recess.si(),
                format!(
                    "with its two ramps of {} less than what lies between the rounded ends",
                    mm(self.ramp.si())
                ),
                "lengthen the spar, or shorten recess or ramps",
            ),
            (true, field) => Fault {
                path: at.key(if field == "length" { "ramp" } else { field }),
                ..fault
            },
            (false, _) => fault,
        }
    }
}

impl JoggleSpar {
    /// Its shape.
    ///
    /// # Errors
    /// What of it bounds no spar.
    pub fn shape(&self) -> Result<SparShape, Fault> {
        swept(self, &Path::to("tool").key("joggle_spar"))
    }
}

fn swept(spar: &JoggleSpar, at: &Path) -> Result<SparShape, Fault> {
    for (name, value) in [
        ("length", spar.length.si()),
        ("top_width", spar.top_width.si()),
        ("height", spar.height.si()),
        ("fillet", spar.fillet.si()),
        ("facet_size", spar.facet_size.si()),
    ] {
        positive(at.key(name), value)?;
    }
    let (fillet, draft) = (spar.fillet.si(), spar.draft.si());
    within(at.key("draft"), draft, [0.0, MOST_DRAFT])?;
    at_most(at.key("fillet"), fillet, spar.height.si(), "`height`")?;
    // Both top edges are rounded.
    let half = 0.5 * spar.top_width.si();
    at_most(at.key("fillet"), fillet, half, "0.5 x `top_width`")?;
    let joggles = spar.joggles.iter().enumerate();
    let joggles = joggles
        .map(|(i, j)| joggle(j, &at.key("joggles").item(i)))
        .collect::<Result<Vec<_>, _>>()?;
    // Along a ramp the edge climbs, and the section square to it is an ellipse, sharper than the circle in the
    // plane x = constant; the circle is enlarged so that the stated radius holds there.
    let enlarge = joggles
        .iter()
        .map(JoggleShape::sharpening)
        .fold(1.0, f64::max);
    let mut shape = SparShape {
        ends: [0.0; 2],
        half_width: half,
        height: spar.height.si(),
        draft,
        fillet: fillet * enlarge,
        corner: 0.0,
        joggles,
    };
    shape.corner = spar.corner.map_or(2.0 * shape.fillet, |c| c.si());
    // `length` is that of the foot on the bed.
    let half = 0.5 * spar.length.si();
    let end_height = shape.height + shape.lift(half, 0.0);
    shape.ends = [
        -half + shape.height * draft.fixed_tan(),
        half - end_height * draft.fixed_tan(),
    ];
    check_fit(spar, &shape, at)?;
    Ok(shape)
}

/// Whether an angle (rad) lies between two others (deg).
fn within(path: Path, angle: f64, [low, high]: [f64; 2]) -> Result<(), Fault> {
    // To rounding of degrees in radians.
    if (low.to_radians() - 1e-9..=high.to_radians() + 1e-9).contains(&angle) {
        return Ok(());
    }
    let fault = Fault::given(Rule::Tool, path, degrees(angle));
    Err(fault.expected(format!("an angle between {low} deg and {high} deg")))
}

fn joggle(j: &Joggle, at: &Path) -> Result<JoggleShape, Fault> {
    let (length, radius, skew) = (j.length.si(), j.fillet.si(), j.skew.si());
    positive(at.key("length"), length)?;
    positive(at.key("fillet"), radius)?;
    within(at.key("skew"), skew, [-MOST_SKEW, MOST_SKEW])?;
    let (rise, sides) = (j.rise.si(), j.side_step.map(|s| s.si()));
    let amplitude = JoggleShape::amplitude(rise, sides);
    let profile = Ramp::new(length * skew.fixed_cos(), amplitude, radius).ok_or_else(|| {
        wrong(
            at.key("length"),
            length,
            format!(
                "at least {}: its fillets of {} with the rise of {} and the side step need that",
                mm(Ramp::shortest(amplitude, radius) / skew.fixed_cos()),
                mm(radius),
                mm(rise),
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
fn check_fit(spar: &JoggleSpar, shape: &SparShape, at: &Path) -> Result<(), Fault> {
    let setback = shape.setback();
    let [from, to] = shape.ends;
    if to - from < 2.1 * shape.corner {
        return Err(wrong(
            at.key("length"),
            spar.length.si(),
            format!(
                "more than {}: two rounded ends of {} and what the end walls lean in",
                mm(spar.length.si() + 2.1 * shape.corner - (to - from)),
                mm(shape.corner)
            ),
            "lengthen the spar, or take smaller `fillet`, `corner` and `draft`",
        ));
    }
    if shape.half_width <= shape.corner.max(setback) * 1.05 {
        return Err(wrong(
            at.key("top_width"),
            spar.top_width.si(),
            format!("more than {}", mm(2.1 * shape.corner.max(setback))),
            "widen the top, or take smaller `fillet` and `corner`",
        ));
    }
    if shape.corner < 1.1 * setback {
        return Err(wrong(
            at.key("corner"),
            shape.corner,
            format!(
                "at least {}, for a fillet of {}",
                mm(1.1 * setback),
                mm(spar.fillet.si())
            ),
            "round the vertical edges at the ends more",
        ));
    }
    let lowest = shape.lowest_top();
    let drop = shape.fillet * (1.0 - shape.arc_angle().fixed_cos());
    if lowest <= drop {
        return Err(wrong(
            at.key("height"),
            spar.height.si(),
            format!(
                "a top, {} at its lowest, that is higher than its fillet, {}",
                mm(lowest),
                mm(drop)
            ),
            "raise the tool or take a smaller fillet",
        ));
    }
    check_places(shape, at)
}

/// Joggles must lie between the rounded ends, one after the other.
fn check_places(shape: &SparShape, at: &Path) -> Result<(), Fault> {
    let rises = shape.joggles.iter().map(|j| j.rise.max(0.0)).sum::<f64>();
    let tallest = shape.height + (shape.lowest_top() - shape.height).abs() + rises;
    let foot = shape.half_width + tallest * shape.draft.fixed_tan();
    let [low, high] = [shape.ends[0] + shape.corner, shape.ends[1] - shape.corner];
    let misplaced = |i: usize, what: String| {
        let path = at.key("joggles").item(i).key("start");
        Fault::text(Rule::Tool, path, what)
            .expected("joggles in order of `start`, without overlap, between the rounded ends")
            .help(
                "`start` counts from the tool's centre: move the joggle, lengthen the tool or reduce `skew`",
            )
    };
    let mut reached = low;
    for (i, j) in shape.joggles.iter().enumerate() {
        // Joggles may slant across each other's x range, but must not meet at any y.
        let slant = if i == 0 {
            foot * j.skew.fixed_tan().abs()
        } else {
            0.0
        };
        let previous = i.checked_sub(1).map(|k| &shape.joggles[k]);
        let lean = previous.map_or(0.0, |p| {
            foot * (p.skew.fixed_tan() - j.skew.fixed_tan()).abs()
        });
        let begin = j.start - slant - lean;
        if begin < reached {
            let begins = format!("with its slant it begins at {}", mm(begin));
            let what = match previous {
                Some(_) => format!(
                    "this joggle begins before the one above ends: {begins}, that one ends at {}",
                    mm(reached)
                ),
                None => format!(
                    "this joggle reaches beyond the tool: {begins}, the rounded end reaches to {}",
                    mm(reached)
                ),
            };
            return Err(misplaced(i, what));
        }
        reached = j.start + j.length;
    }
    for (i, j) in shape.joggles.iter().enumerate() {
        let end = j.start + j.length + foot * j.skew.fixed_tan().abs();
        if end > high {
            let what = format!(
                "this joggle reaches beyond the tool: with length and slant it ends at {}, the rounded end begins at {}",
                mm(end),
                mm(high)
            );
            return Err(misplaced(i, what));
        }
    }
    Ok(())
}
