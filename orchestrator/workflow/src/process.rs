//! Rules of a scene as a whole: the order of the stack, pressures, and the frame around the plies.
//! All of them need only the words of the scene, so that nothing has to run before they are told.

use crate::check::out_of_bounds;
use crate::diagnostics::{Problems, Source};
use crate::friction;
use crate::yaml::{Kind, Node};
use plyflow_model::scene::Contour;
use plyflow_model::units::{Dimension, parse_quantity, si_number};

/// A sheet whose name and kind are sound.
pub struct Sheet<'a> {
    node: &'a Node,
    /// Its name.
    pub name: &'a str,
    kind: &'a Node,
    /// Whether it is a diaphragm.
    pub film: bool,
}

impl Sheet<'_> {
    /// What says where it lies.
    pub fn outline(&self) -> [Option<serde_json::Value>; 5] {
        let keys = ["length", "width", "outline", "holes", "centre"];
        keys.map(|key| self.node.get(key).map(Node::to_json))
    }
}

/// Checks the scene against its process.
pub fn rules(scene: &Node, source: &Source, problems: &mut Problems) {
    let Some(process) = scene.get("process") else {
        return;
    };
    // Several kinds of process, or none, have been reported by the schema check.
    let [kind] = process.entries() else {
        return;
    };
    let sheets = scene.get("sheets").map_or(&[][..], Node::items);
    let sheets: Option<Vec<Sheet<'_>>> = sheets.iter().map(sheet).collect();
    let sheets = sheets.filter(|s| !s.is_empty());
    let bag = kind.key == "double_diaphragm";
    if !bag && kind.key != "press" {
        return;
    }
    if let Some(sheets) = &sheets {
        let in_order = stack(sheets, &kind.key, source, problems);
        friction::pairs(scene, sheets, kind, in_order, source, problems);
        if bag {
            frame(&kind.value, sheets, source, problems);
        }
    }
    if bag {
        pressures(&kind.value, source, problems);
    }
}

fn sheet(node: &Node) -> Option<Sheet<'_>> {
    let kind = node.get("kind")?;
    let film = match kind.text()? {
        "diaphragm" => true,
        "ply" => false,
        _ => return None,
    };
    let name = node.get("name")?.text()?;
    Some(Sheet {
        node,
        name,
        kind,
        film,
    })
}

/// The order of the sheets, as `forming-explicit` needs it; whether it is right.
fn stack(sheets: &[Sheet<'_>], process: &str, source: &Source, problems: &mut Problems) -> bool {
    let films: Vec<bool> = sheets.iter().map(|s| s.film).collect();
    let last = films.len() - 1;
    let (at, expected, help) = if process == "press" {
        let Some(at) = films.iter().position(|f| *f) else {
            return true;
        };
        (
            at,
            "plies alone".to_owned(),
            "a press has no films: leave the diaphragms out, or form the stack by `double_diaphragm`",
        )
    } else {
        let inside = || films[1..last].iter().position(|f| *f);
        let (at, here) = if !films[0] {
            (0, "a diaphragm below it")
        } else if last == 0 {
            (0, "plies and a diaphragm above it")
        } else if last == 1 && films[1] {
            (1, "a ply below it")
        } else if let Some(k) = inside() {
            (k + 1, "no further diaphragm here")
        } else if !films[last] {
            (last, "a diaphragm above it")
        } else {
            return true;
        };
        (
            at,
            format!("{here}: one diaphragm, one or more plies, one diaphragm"),
            "the sheets stand from the tool upwards; plies without films are formed by `press`",
        )
    };
    let message = format!(
        "the sheets do not make a stack for `{process}`: from the tool upwards they are {}",
        runs(&films)
    );
    let d = problems.add(source, &sheets[at].kind.span, message);
    d.given(runs(&films)).expected(expected).help(help);
    false
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

/// The rows of the course of a pressure, (share, pressure) with their nodes; one without a share for a single value.
/// `None` where something is no number, which has been reported.
fn course(node: &Node) -> Option<Vec<(Option<&Node>, f64, &Node)>> {
    let pressure = |n: &Node| parse_quantity(n.text()?, Dimension::Pressure).ok();
    let Some(table) = node.get("table") else {
        return Some(vec![(None, pressure(node)?, node)]);
    };
    let row = |row| {
        let (share, at): (&Node, &Node) = (Node::get(row, "share")?, row.get("pressure")?);
        Some((Some(share), pressure(at)?, at))
    };
    matches!(table.kind, Kind::List(_))
        .then(|| table.items().iter().map(row).collect())
        .flatten()
}

/// Pressures: tables run over their phase, and no more is drawn than the bag has.
fn pressures(process: &Node, source: &Source, problems: &mut Problems) {
    let of = |name: &str| Some((process.get(name)?, course(process.get(name)?)?));
    let (bag, forming) = (of("bag_pressure"), of("forming_pressure"));
    let mut sound = true;
    for (phase, found) in [("bagging", &bag), ("drawing", &forming)] {
        if let Some((node, rows)) = found {
            sound &= table(node, rows, phase, source, problems);
        }
    }
    let (Some((given, bag)), Some((_, rows))) = (bag, forming) else {
        return;
    };
    let Some((_, most, _)) = bag.last().filter(|_| sound) else {
        return;
    };
    if let Some((_, _, at)) = rows.iter().find(|(_, p, _)| *p > most * (1.0 + 1e-9)) {
        let most = match given.text() {
            Some(text) => text.to_owned(),
            None => format!("{} Pa at its end", si_number(*most)),
        };
        let expected = format!("at most `bag_pressure` ({most})");
        out_of_bounds(at, "forming_pressure", expected, source, problems)
            .help("more than the vacuum of the bag there is not to be drawn");
    }
}

/// Whether the rows of a table run over their phase; a single value always does.
fn table(
    node: &Node,
    rows: &[(Option<&Node>, f64, &Node)],
    phase: &str,
    source: &Source,
    problems: &mut Problems,
) -> bool {
    let Some(table) = node.get("table") else {
        return true;
    };
    if rows.len() < 2 {
        let given = friction::row_count(rows.len());
        let d = problems.add(source, &table.span, format!("the table has {given}"));
        d.given(given)
            .expected("two or more, from `{share: 0, pressure: 0 kPa}` to `share: 1`");
        return false;
    }
    let share = |k: usize| match rows[k].0.map(|n| &n.kind) {
        Some(Kind::Number(n)) => n.as_f64(),
        _ => None,
    };
    let mut before = f64::NEG_INFINITY;
    for (k, (at, pressure, pressure_at)) in rows.iter().enumerate() {
        let (Some(value), Some(at)) = (share(k), at) else {
            return false;
        };
        let expected = if k == 0 && value != 0.0 {
            Some(format!("0, where {phase} begins"))
        } else if value <= before {
            Some(format!("more than the {before} of the row before"))
        } else if k + 1 == rows.len() && value != 1.0 {
            Some(format!("1 in the last row, where {phase} ends"))
        } else {
            None
        };
        if let Some(expected) = expected {
            out_of_bounds(at, "share", expected, source, problems);
            return false;
        }
        if k == 0 && *pressure != 0.0 {
            let expected = format!("`0 Pa`, so that nothing jumps when {phase} begins");
            out_of_bounds(pressure_at, "pressure", expected, source, problems);
            return false;
        }
        before = value;
    }
    true
}

/// The frame must be larger than every ply where it lies.
fn frame(process: &Node, sheets: &[Sheet<'_>], source: &Source, problems: &mut Problems) {
    for (axis, name) in [(0, "frame_length"), (1, "frame_width")] {
        let Some(at) = process.get(name) else {
            continue;
        };
        let read = |n: &Node| parse_quantity(n.text()?, Dimension::Length).ok();
        let Some(opening) = read(at) else { continue };
        let plies = sheets.iter().filter(|s| !s.film);
        let needs = plies.filter_map(|s| Some((s.name, 2.0 * reach(s.node, axis)?)));
        let Some((ply, needed)) = needs.max_by(|a, b| a.1.total_cmp(&b.1)) else {
            continue;
        };
        // To rounding: a ply as large as the frame is refused by the run, with what it needs beside.
        if opening < needed * (1.0 - 1e-9) {
            let mm = si_number((1e6 * needed).round() / 1e3);
            let expected = format!("more than the {mm} mm that ply `{ply}` takes");
            out_of_bounds(at, name, expected, source, problems).help(
                "the frame is centred over the tool; it holds the plies, and free film around plies and tool",
            );
        }
    }
}

/// How far a ply reaches from the tool's axis along x or y (m).
fn reach(ply: &Node, axis: usize) -> Option<f64> {
    let read = |n: &Node| parse_quantity(n.text()?, Dimension::Length).ok();
    let centre = match ply.get("centre") {
        Some(node) => read(node.items().get(axis)?)?,
        None => 0.0,
    };
    if let Some(outline) = ply.get("outline") {
        let contour: Contour = serde_json::from_value(outline.to_json()).ok()?;
        let far = |p: &[f64; 2]| (p[axis] + centre).abs();
        return contour.corners().iter().map(far).reduce(f64::max);
    }
    let size = read(ply.get(["length", "width"][axis])?)?;
    Some(centre.abs() + 0.5 * size)
}
