//! Rules of single sheets: names, sizes, fibres.

use crate::fault::{Fault, Path, Rule, Shown, degrees};
use crate::material::MaterialEntry;
use crate::outline::{ContourName, OutlineError, Region};
use crate::process::Process;
use crate::rules::known::Known;
use crate::rules::steering;
use crate::scene::{FibreDirection, Sheet, SheetKind};
use crate::steering::SQUARE;
use crate::text::{WORD, is_word};
use crate::units::si_number;

/// Names that sheets may not have: what is rigid is a body of the artifact, or a part that rubs, under its own name.
pub const RIGID: [&str; 4] = ["tool", "bed", "die", "holder"];

/// Least angle between the fibre families (deg). Nearer to each other they are one family, and no yarn lies across: a net of cells so
/// slim is none.
pub const LEAST_CROSSING: f64 = 6.0;

/// All that is wrong with single sheets.
pub fn check(known: &Known<'_>) -> Vec<Fault> {
    let mut found = Vec::new();
    let mut names = RIGID.to_vec();
    if let Some(Process::Stamping(stamping)) = known.process {
        names.extend(stamping.parts.iter().map(|part| part.name.as_str()));
    }
    for (k, sheet) in known.numbered() {
        let at = Path::to("sheets").item(k);
        found.extend(name(sheet, &names, at.key("name")));
        names.push(&sheet.name);
        match sheet.kind {
            SheetKind::Ply => {
                size(sheet, &at, &mut found);
                found.extend(tied(known, k, sheet, &at));
                match &sheet.fibre_1 {
                    FibreDirection::Straight(_) => found.extend(fibres(sheet, at.key("fibre_2"))),
                    FibreDirection::Steered(s) => found.extend(steering::check(sheet, s, &at)),
                }
            }
            SheetKind::Diaphragm => diaphragm(sheet, &at, &mut found),
        }
    }
    found
}

fn name(sheet: &Sheet, taken: &[&str], path: Path) -> Option<Fault> {
    let name = &sheet.name;
    if taken.contains(&name.as_str()) {
        return Some(
            Fault::text(Rule::Name, path, format!("the name `{name}` is taken")).expected(
                "a name of its own for every sheet, other than `tool`, `bed`, `die` and `holder` and those of rigid parts",
            ),
        );
    }
    (!is_word(name)).then(|| {
        Fault::text(Rule::Name, path, format!("`{name}` cannot name a body")).expected(WORD)
    })
}

/// What only plies have.
fn diaphragm(sheet: &Sheet, at: &Path, found: &mut Vec<Fault>) {
    for (name, given) in [
        ("length", sheet.length.is_some()),
        ("width", sheet.width.is_some()),
        ("outline", sheet.outline.is_some()),
        ("holes", !sheet.holes.is_empty()),
        ("centre", sheet.centre.iter().any(|c| c.si() != 0.0)),
        ("fibre_1", sheet.fibre_1 != FibreDirection::default()),
        ("fibre_2", sheet.fibre_2.is_some()),
        ("regions", !sheet.regions.is_empty()),
        ("tied", sheet.tied),
    ] {
        if given {
            let fault = Fault::text(
                Rule::Size,
                at.key(name),
                format!("a diaphragm has no `{name}`"),
            );
            found.push(fault.shown(Shown::Key).help(
                "diaphragms fill the frame of the process and have no fibres; only plies have a shape of their own",
            ));
        }
    }
}

/// Only on another ply a ply is tied.
fn tied(known: &Known<'_>, k: usize, sheet: &Sheet, at: &Path) -> Option<Fault> {
    let below = k.checked_sub(1).map(|below| known.sheets[below]);
    // A sheet below that could not be read is told by itself.
    if !sheet.tied || matches!(below, Some(None)) {
        return None;
    }
    let text = match below.flatten() {
        Some(below) if below.kind == SheetKind::Ply => return None,
        Some(below) => format!("`{}` lies on the diaphragm `{}`", sheet.name, below.name),
        None => format!("no sheet lies below `{}`", sheet.name),
    };
    let fault = Fault::text(Rule::Stack, at.key("tied"), text).shown(Shown::Key);
    Some(
        fault.expected(
            "a ply below it, to which it is tied: sheets are listed from the tool upwards",
        ),
    )
}

fn size(sheet: &Sheet, at: &Path, found: &mut Vec<Fault>) {
    let outlined = sheet.outline.is_some();
    let needs = |name: &str, example: &str| {
        let text = format!("a ply needs `{name}`");
        Fault::text(Rule::Size, at.key(name), text)
            .shown(Shown::Beside("kind"))
            .expected(format!("`{name}: {example}`, say"))
    };
    for (name, given) in [("length", sheet.length), ("width", sheet.width)] {
        match given {
            Some(_) if outlined => {
                let text = format!("`{name}` stands beside `outline`");
                found.push(
                    Fault::text(Rule::Size, at.key(name), text)
                        .shown(Shown::Key)
                        .expected("an `outline`, or `length` and `width` of a rectangle"),
                );
            }
            None if !outlined => found.push(needs(name, "300 mm").help(
                "a ply that is no rectangle has an `outline` instead of `length` and `width`",
            )),
            _ => {}
        }
    }
    if sheet.fibre_2.is_none() && matches!(sheet.fibre_1, FibreDirection::Straight(_)) {
        found.push(needs("fibre_2", "45 deg"));
    }
    found.extend(outline(sheet, at));
}

/// What is wrong with outline and holes.
fn outline(sheet: &Sheet, at: &Path) -> Option<Fault> {
    // Relative to the sheet's centre, as they are written.
    let holes = sheet.holes.iter().map(|hole| hole.corners()).collect();
    let error = match &sheet.outline {
        // What another step makes is looked at once it is there.
        Some(_) if matches!(sheet.region(), Err(OutlineError::NotRead { .. })) => return None,
        Some(outline) => Region::new(outline.corners(), holes).err()?,
        None => sheet.region().err()?,
    };
    let path = match error.contour() {
        Some(ContourName::Hole(i)) => at.key("holes").item(i),
        Some(ContourName::Outline) => at.key("outline"),
        None => at.key("holes"),
    };
    let fault = match error {
        OutlineError::HolesAlone => {
            Fault::text(Rule::Outline, path, "`holes` stand without `outline`")
                .shown(Shown::Key)
                .expected("an `outline` around the holes")
                .help("a rectangle with holes is an outline of four points")
        }
        error => Fault::text(Rule::Outline, path, error.to_string()).help(
            "points count from 0 in the order of the file; places are relative to the sheet's `centre`",
        ),
    };
    Some(fault)
}

/// The families must cross, and where the material says at which angle, at that one.
fn fibres(sheet: &Sheet, path: Path) -> Option<Fault> {
    sheet.fibre_2?;
    cross(sheet, path.clone()).or_else(|| agree(sheet, path))
}

/// Whether the families lie as the material's law has them.
fn agree(sheet: &Sheet, path: Path) -> Option<Fault> {
    let MaterialEntry::Inline(material) = &sheet.material else {
        return None;
    };
    let crossing = material.crossing()?;
    let [first, second] = sheet.fibres()?;
    // The law's second family follows its first one counter-clockwise: turned by 180 deg it would be the same line, but scenes are to be read.
    let given = (second - first).rem_euclid(std::f64::consts::TAU);
    ((given - crossing).abs() > SQUARE).then(|| {
        let text = format!(
            "`fibre_2` lies {} counter-clockwise from `fibre_1`, and the families of the material `{}` cross at {} (`with.crossing`)",
            degrees(given),
            material.name,
            degrees(crossing)
        );
        Fault::text(Rule::Fibres, path, text)
            .expected(format!("`fibre_2: {}`", degrees(first + crossing)))
    })
}

/// Whether the families are two.
fn cross(sheet: &Sheet, path: Path) -> Option<Fault> {
    let [first, second] = sheet.fibres()?;
    // A fibre has no sense: directions 180 deg apart are the same.
    let apart = (second - first).to_degrees().rem_euclid(180.0);
    let apart = apart.min(180.0 - apart);
    // To rounding of degrees in radians.
    (apart < LEAST_CROSSING - 1e-9).then(|| {
        let text = format!(
            "`fibre_1` and `fibre_2` lie along each other, {} deg apart",
            si_number((1e3 * apart).round() / 1e3)
        );
        Fault::text(Rule::Fibres, path, text)
            .expected(format!(
                "a direction that crosses `fibre_1` at {LEAST_CROSSING} deg or more"
            ))
            .help("the families of most fabrics cross at 90 deg: `fibre_1: -45 deg`, `fibre_2: 45 deg`, say")
    })
}
