//! Rules of a scene and its process: the order of the stack, pressures, and what must hold the plies.

use crate::fault::{Fault, Path, Phrase, Rule, bar, mm};
use crate::material::MaterialEntry;
use crate::process::{
    DoubleDiaphragm, Hold, Press, PressureCourse, Process, SingleDiaphragm, WeightDirection,
};
use crate::rules::friction::row_count;
use crate::rules::known::Known;
use crate::rules::stamping;
use crate::scene::{Sheet, SheetKind};
use crate::units::{Length, si_number};
use plyflow_fixed::FixedBits;

/// The order of the sheets, when it is not that of the process.
pub fn stack(known: &Known<'_>) -> Option<Fault> {
    let process = known.process?;
    let sheets = known.whole_stack()?;
    let films: Vec<bool> = (sheets.iter())
        .map(|s| s.kind == SheetKind::Diaphragm)
        .collect();
    let (at, expected, help) = match process {
        Process::Press(_) | Process::Stamping(_) => (
            films.iter().position(|f| *f)?,
            "plies alone".to_owned(),
            "a press has no films: leave the diaphragms out, or form the stack by `double_diaphragm` or `single_diaphragm`",
        ),
        Process::SingleDiaphragm(_) => {
            let (at, here) = misplaced_under_one(&films)?;
            (
                at,
                format!("{here}: one or more plies, one diaphragm"),
                "the sheets stand from the tool upwards; plies between two films are formed by `double_diaphragm`, plies without films by `press`",
            )
        }
        Process::DoubleDiaphragm(_) => {
            let (at, here) = misplaced(&films)?;
            (
                at,
                format!("{here}: one diaphragm, one or more plies, one diaphragm"),
                "the sheets stand from the tool upwards; plies without films are formed by `press`",
            )
        }
    };
    let text = format!(
        "the sheets do not make a stack for `{}`: from the tool upwards they are {}",
        process.word(),
        runs(&films)
    );
    let path = Path::to("sheets").item(at).key("kind");
    let fault = Fault::text(Rule::Stack, path, text);
    Some(fault.expected(expected).help(help))
}

/// The sheet that is not where it should be between two films, and what belongs there.
fn misplaced(films: &[bool]) -> Option<(usize, &'static str)> {
    let last = films.len() - 1;
    let inside = || films[1..last].iter().position(|f| *f);
    if !films[0] {
        Some((0, "a diaphragm below it"))
    } else if last == 0 {
        Some((0, "plies and a diaphragm above it"))
    } else if last == 1 && films[1] {
        Some((1, "a ply below it"))
    } else if let Some(k) = inside() {
        Some((k + 1, "no further diaphragm here"))
    } else {
        (!films[last]).then_some((last, "a diaphragm above it"))
    }
}

/// The sheet that is not where it should be under one film, and what belongs there.
fn misplaced_under_one(films: &[bool]) -> Option<(usize, &'static str)> {
    let last = films.len() - 1;
    if films == [true] {
        Some((0, "plies below it"))
    } else if let Some(k) = films[..last].iter().position(|f| *f) {
        Some((k, "no diaphragm here"))
    } else {
        (!films[last]).then_some((last, "a diaphragm above it"))
    }
}

/// "1 diaphragm, 2 plies, 1 diaphragm".
fn runs(films: &[bool]) -> String {
    let word = |run: &[bool]| match (run[0], run.len()) {
        (true, 1) => "1 diaphragm".to_owned(),
        (true, n) => format!("{n} diaphragms"),
        (false, 1) => "1 ply".to_owned(),
        (false, n) => format!("{n} plies"),
    };
    let runs: Vec<String> = films.chunk_by(|a, b| a == b).map(word).collect();
    runs.join(", ")
}

/// What is wrong with the process itself and the plies in it.
pub fn check(known: &Known<'_>) -> Vec<Fault> {
    let mut found = Vec::new();
    match known.process {
        Some(process @ Process::DoubleDiaphragm(p)) => {
            if p.clearance.si() < 0.0 {
                let fault = Fault::given(Rule::Frame, at("clearance"), mm(p.clearance.si()));
                found.push(fault.expected("0 mm or more: the stack begins above the tool"));
            }
            pressures(p, &mut found);
            frame(known, process, &mut found);
        }
        Some(process @ Process::SingleDiaphragm(p)) => {
            single(p, &mut found);
            frame(known, process, &mut found);
        }
        Some(Process::Press(press)) => {
            let stroke = press.stroke.si();
            if stroke.is_nan() || stroke <= 0.0 {
                let path = Path::to("process").key("press").key("stroke");
                let fault = Fault::given(Rule::Press, path, mm(stroke));
                found.push(fault.expected("more than 0 mm, the way of the punch"));
            }
            found.extend(gap(known, press));
            found.extend(reach_of_die(known, press));
        }
        Some(Process::Stamping(stamping)) => stamping::check(known, stamping, &mut found),
        None => {}
    }
    found
}

fn at(name: &str) -> Path {
    Path::to("process").key("double_diaphragm").key(name)
}

fn at_single(name: &str) -> Path {
    Path::to("process").key("single_diaphragm").key(name)
}

/// What is wrong with the process under one film, besides its frame.
fn single(p: &SingleDiaphragm, found: &mut Vec<Fault>) {
    if p.clearance.si() < 0.0 {
        let fault = Fault::given(Rule::Frame, at_single("clearance"), mm(p.clearance.si()));
        found.push(fault.expected("0 mm or more: the film begins above the plies"));
    }
    if let (true, Some(height)) = (p.bed, p.frame_height) {
        let fault = Fault::given(Rule::Frame, at_single("frame_height"), mm(height.si()));
        found.push(
            fault
                .expected("no `frame_height` where there is a bed, onto which the frame comes down")
                .help("`bed: false` takes the bed away"),
        );
    }
    if let Some(height) = p.frame_height.filter(|h| h.si() < 0.0) {
        let fault = Fault::given(Rule::Frame, at_single("frame_height"), mm(height.si()));
        found.push(fault.expected("0 mm or more: the tool stands on z = 0"));
    }
    if p.weight == Some(WeightDirection::Away) {
        let text = "given `away`, which pulls the plies off the tool, where nothing holds them";
        let fault = Fault::text(Rule::Pressure, at_single("weight"), text);
        found.push(
            fault.expected("`tool`, or no `weight`").help(
                "a tool that hangs over the plies needs a film below them: `double_diaphragm`",
            ),
        );
    }
    drawn_from_surroundings(p, found);
}

/// Pressures under one film: a table runs over drawing, something presses, and no more is drawn than there is.
fn drawn_from_surroundings(p: &SingleDiaphragm, found: &mut Vec<Fault>) {
    let path = at_single("forming_pressure");
    if let Some(fault) = table(&p.forming_pressure, &path, "drawing") {
        found.push(fault);
        return;
    }
    let around = p.surroundings.si();
    let fault = |path, pressure| Fault::given(Rule::Pressure, path, bar(pressure));
    if !(around > 0.0 && around.is_finite()) {
        let fault = fault(at_single("surroundings"), around);
        found.push(fault.expected("more than 0 Pa: without it nothing is formed"));
        return;
    }
    let drawn = values(&p.forming_pressure, &path);
    let (at, last) = drawn.last().cloned().unwrap_or((path, 0.0));
    if !(last > 0.0 && last.is_finite()) {
        let fault = fault(at, last);
        found.push(fault.expected("more than 0 Pa at the end: without it nothing is formed"));
    }
    if let Some((at, pressure)) = drawn.into_iter().find(|d| d.1 > around * (1.0 + 1e-9)) {
        let given = at_single("surroundings");
        let expected = Phrase::with_value("at most `surroundings` (", (given, bar(around)), ")");
        found.push(
            fault(at, pressure)
                .expected(expected)
                .help("more than all air under the film there is not to be drawn; in an autoclave `surroundings` are more than 1 bar"),
        );
    }
}

/// Places and values (Pa) of a pressure: those of its table, or its own.
fn values(course: &PressureCourse, path: &Path) -> Vec<(Path, f64)> {
    match course {
        PressureCourse::Value(p) => vec![(path.clone(), p.si())],
        PressureCourse::Course(c) => (c.table.iter().enumerate())
            .map(|(k, row)| (path.key("table").item(k).key("pressure"), row.pressure.si()))
            .collect(),
    }
}

/// Pressures: tables run over their phase, something presses, and no more is drawn than the bag has.
fn pressures(p: &DoubleDiaphragm, found: &mut Vec<Fault>) {
    let before = found.len();
    let [bag, forming] = [
        ("bag_pressure", &p.bag_pressure),
        ("forming_pressure", &p.forming_pressure),
    ];
    for ((name, course), phase) in [(bag, "bagging"), (forming, "drawing")] {
        found.extend(table(course, &at(name), phase));
    }
    if found.len() > before {
        return;
    }
    for (name, course) in [bag, forming] {
        let (path, last) = values(course, &at(name)).pop().unwrap_or((at(name), 0.0));
        if !(last > 0.0 && last.is_finite()) {
            let fault = Fault::given(Rule::Pressure, path, bar(last));
            found.push(fault.expected("more than 0 Pa at the end: without it nothing is formed"));
        }
    }
    let Some((given, most)) = values(bag.1, &at(bag.0)).pop() else {
        return;
    };
    let drawn = values(forming.1, &at(forming.0));
    if let Some((path, pressure)) = drawn.into_iter().find(|d| d.1 > most * (1.0 + 1e-9)) {
        let after = match bag.1 {
            PressureCourse::Value(_) => ")",
            PressureCourse::Course(_) => " at its end)",
        };
        let fault = Fault::given(Rule::Pressure, path, bar(pressure));
        let expected = Phrase::with_value("at most `bag_pressure` (", (given, bar(most)), after);
        found.push(
            fault
                .expected(expected)
                .help("more than the vacuum of the bag there is not to be drawn"),
        );
    }
}

/// What keeps the rows of a table from running over their phase; a single value always does.
fn table(course: &PressureCourse, path: &Path, phase: &str) -> Option<Fault> {
    let PressureCourse::Course(course) = course else {
        return None;
    };
    let (path, rows) = (path.key("table"), &course.table);
    if rows.len() < 2 {
        let text = format!("the table has {}", row_count(rows.len()));
        let fault = Fault::text(Rule::Pressure, path, text);
        return Some(
            fault.expected("two or more, from `{share: 0, pressure: 0 kPa}` to `share: 1`"),
        );
    }
    let mut before = f64::NEG_INFINITY;
    for (k, row) in rows.iter().enumerate() {
        let (share, pressure) = (row.share.0, row.pressure.si());
        let expected = if k == 0 && share != 0.0 {
            Some(format!("0, where {phase} begins"))
        } else if share <= before {
            Some(format!("more than the {before} of the row before"))
        } else if k + 1 == rows.len() && share != 1.0 {
            Some(format!("1 in the last row, where {phase} ends"))
        } else {
            None
        };
        let at = path.item(k);
        if let Some(expected) = expected {
            let fault = Fault::given(Rule::Pressure, at.key("share"), si_number(share));
            return Some(fault.expected(expected));
        }
        let fault = || Fault::given(Rule::Pressure, at.key("pressure"), bar(pressure));
        if !(pressure >= 0.0 && pressure.is_finite()) {
            return Some(fault().expected("0 Pa or more"));
        }
        if k == 0 && pressure != 0.0 {
            return Some(
                fault().expected(format!("`0 Pa`, so that nothing jumps when {phase} begins")),
            );
        }
        before = share;
    }
    None
}

/// The frame must be larger than every ply where it lies.
fn frame(known: &Known<'_>, process: &Process, found: &mut Vec<Fault>) {
    let Some(openings) = process.frame() else {
        return;
    };
    for (axis, name) in ["frame_length", "frame_width"].into_iter().enumerate() {
        let opening = openings[axis];
        let needs = known
            .plies()
            .filter_map(|(_, s)| Some((s, 2.0 * reach(s, axis)?)));
        let Some((ply, needed)) = needs.max_by(|a, b| a.1.total_cmp(&b.1)) else {
            continue;
        };
        // To rounding: a ply as large as the frame is refused by the run, with what it needs beside.
        if opening < needed * (1.0 - 1e-9) {
            let path = Path::to("process").key(process.word()).key(name);
            let fault = Fault::given(Rule::Frame, path, mm(opening));
            let expected = format!("more than the {} that ply `{}` takes", mm(needed), ply.name);
            found.push(fault.expected(expected).help(
                "the frame is centred over the tool; it holds the plies, and free film around plies and tool",
            ));
        }
    }
}

/// How far a ply reaches from the tool's axis along x or y (m).
fn reach(ply: &Sheet, axis: usize) -> Option<f64> {
    let region = ply.footprint().ok()??;
    region
        .outline
        .iter()
        .map(|p| p[axis].abs())
        .reduce(f64::max)
}

/// A holder that keeps a gap must leave the plies room.
fn gap(known: &Known<'_>, press: &Press) -> Option<Fault> {
    let Some(Hold::Gap(Length(gap))) = press.holder.as_ref().map(|h| &h.hold) else {
        return None;
    };
    let thickness = |sheet: &&Sheet| match &sheet.material {
        MaterialEntry::Inline(material) => Some(material.thickness.si()),
        _ => None,
    };
    let stack = known.whole_stack()?;
    let all: Option<Vec<f64>> = stack.iter().map(thickness).collect();
    let thickness: f64 = all?.iter().sum();
    // To rounding of the sum.
    (*gap < thickness * (1.0 - 1e-9)).then(|| {
        let path = Path::to("process").key("press").key("holder");
        Fault::given(Rule::Press, path.key("hold").key("gap"), mm(*gap))
            .expected(format!(
                "a gap that the plies fit into, which are {} thick",
                mm(thickness)
            ))
            .help("`hold: {force: ..}` squeezes them")
    })
}

/// A ply that lies all inside of the die's opening would never touch the die.
fn reach_of_die(known: &Known<'_>, press: &Press) -> Option<Fault> {
    let opening = press.die.opening_radius.si();
    known.plies().find_map(|(_, ply)| {
        let region = ply.footprint().ok()??;
        let far = region.outline.iter().map(|p| p[0].fixed_hypot(p[1]));
        let reach = far.reduce(f64::max)?;
        (reach <= opening).then(|| {
            let path = Path::to("process").key("press").key("die");
            Fault::given(Rule::Press, path.key("opening_radius"), mm(opening))
                .expected(format!(
                    "less than the {} to which ply `{}` reaches from the axis",
                    mm(reach),
                    ply.name
                ))
                .help("a ply inside of the opening would never touch the die: expected a ply that covers it")
        })
    })
}
