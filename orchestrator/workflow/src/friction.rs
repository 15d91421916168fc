//! Rules of friction: what must be given, laws that make sense, and pairs of surfaces that touch.

use crate::check::out_of_bounds;
use crate::diagnostics::{Problems, Source};
use crate::process::Sheet;
use crate::yaml::{Entry, Kind, Node};
use plyflow_model::units::{Dimension, parse_quantity};

/// Largest coefficient that the solver takes.
const LARGEST: f64 = 2.0;

/// Checks what the stack needs, and every law.
pub fn rules(scene: &Node, source: &Source, problems: &mut Problems) {
    needed(scene, source, problems);
    let Some(friction) = scene.get("friction") else {
        return;
    };
    for entry in friction.entries() {
        if entry.key == "pairs" {
            for pair in entry.value.items() {
                law(pair, source, problems);
            }
        } else if matches!(entry.value.kind, Kind::Map(_)) {
            law(&entry.value, source, problems);
        }
    }
}

/// Coefficients of the surfaces that touch in this stack and process.
fn needed(scene: &Node, source: &Source, problems: &mut Problems) {
    let (Some(entry), Some(sheets)) = (scene.entry("friction"), scene.get("sheets")) else {
        return;
    };
    if !matches!(entry.value.kind, Kind::Map(_)) {
        return;
    }
    let count = |kind: &str| {
        let of = |s: &&Node| s.get("kind").and_then(Node::text) == Some(kind);
        sheets.items().iter().filter(of).count()
    };
    let press = scene
        .get("process")
        .is_some_and(|p| p.get("press").is_some());
    let films = count("diaphragm") > 0;
    let why_films = "the stack has diaphragms";
    for (name, needed, why) in [
        ("tool_diaphragm", films, why_films),
        ("fabric_diaphragm", films, why_films),
        ("diaphragm_diaphragm", films, why_films),
        ("fabric_fabric", count("ply") > 1, "plies lie on each other"),
        ("tool_fabric", press, "a press touches the plies"),
    ] {
        if needed && entry.value.get(name).is_none() {
            let message = format!("`{name}` is missing in `friction`");
            let d = problems.add(source, &entry.key_span, message);
            d.expected(format!("`{name}: ..`"))
                .help(format!("it is needed because {why}"));
        }
    }
}

/// A law by pressure and direction: one coefficient or a table of them, tables in order.
fn law(node: &Node, source: &Source, problems: &mut Problems) {
    if !matches!(node.kind, Kind::Map(_)) {
        return;
    }
    let coefficient = node
        .entry("coefficient")
        .filter(|e| e.value.kind != Kind::Null);
    let pressure = node.get("pressure");
    let table = pressure.and_then(|p| p.get("table"));
    let mut largest = coefficient.and_then(|c| number(&c.value));
    match (table, coefficient) {
        (Some(_), Some(given)) => {
            let message = "`coefficient` stands beside a table by pressure, which says it all";
            problems
                .add(source, &given.key_span, message)
                .help("remove one of the two");
        }
        (Some(table), None) => {
            rows(table, "pressure", Dimension::Pressure, source, problems);
            let all = table.items().iter();
            let all = all.filter_map(|r| number(r.get("coefficient")?));
            largest = all.reduce(f64::max);
        }
        (None, None) => {
            let at = node.entries().first().map_or(&node.span, |e| &e.key_span);
            problems
                .add(source, at, "the law of friction has no `coefficient`")
                .expected("`coefficient: ..`, a number from 0 to 2")
                .help("only a table by pressure says it in another place");
        }
        (None, Some(_)) => {}
    }
    let exponent = pressure.and_then(|p| p.get("power")?.get("exponent"));
    if let Some(at) = exponent.filter(|n| number(n) == Some(-1.0)) {
        let expected = "more than -1: friction would not grow with pressure".to_owned();
        out_of_bounds(at, "exponent", expected, source, problems);
    }
    let Some(factors) = node.get("angle").and_then(|a| a.get("factors")) else {
        return;
    };
    rows(factors, "angle", Dimension::Angle, source, problems);
    for row in factors.items() {
        let (Some(at), Some(largest)) = (row.get("factor"), largest) else {
            continue;
        };
        if let Some(factor) = number(at).filter(|f| f * largest > LARGEST) {
            let expected = format!(
                "a coefficient of at most {LARGEST} in all (here {})",
                factor * largest
            );
            out_of_bounds(at, "factor", expected, source, problems);
        }
    }
}

fn number(node: &Node) -> Option<f64> {
    match &node.kind {
        Kind::Number(n) => n.as_f64(),
        _ => None,
    }
}

/// "no row", "one row": what a table with too few of them has.
pub fn row_count(rows: usize) -> &'static str {
    if rows == 0 { "no row" } else { "one row" }
}

/// Two or more rows in which `key` grows.
fn rows(table: &Node, key: &str, dimension: Dimension, source: &Source, problems: &mut Problems) {
    let Kind::List(all) = &table.kind else {
        return;
    };
    if all.len() < 2 {
        let given = row_count(all.len());
        let d = problems.add(source, &table.span, format!("the table has {given}"));
        d.given(given)
            .expected(format!("two or more rows with growing `{key}`"));
        return;
    }
    let mut before: Option<(f64, &str)> = None;
    for row in all {
        let Some((at, text)) = row.get(key).and_then(|n| Some((n, n.text()?))) else {
            return;
        };
        let Ok(value) = parse_quantity(text, dimension) else {
            return;
        };
        if let Some((_, given)) = before.filter(|b| value <= b.0) {
            let expected = format!("more than the {given} of the row before");
            out_of_bounds(at, key, expected, source, problems);
            return;
        }
        before = Some((value, text));
    }
}

/// Pairs of `friction` that name what the scene does not have, what does not touch, or the same twice.
pub fn pairs(
    scene: &Node,
    sheets: &[Sheet<'_>],
    process: &Entry,
    in_order: bool,
    source: &Source,
    problems: &mut Problems,
) {
    let given = scene.get("friction").and_then(|f| f.get("pairs"));
    let given = given.map_or(&[][..], Node::items);
    if given.is_empty() {
        return;
    }
    let bag = process.key == "double_diaphragm";
    let rigid: &[&str] = match (bag, process.value.get("holder").is_some()) {
        (true, _) => &["tool", "bed"],
        (false, true) => &["tool", "die", "holder"],
        (false, false) => &["tool", "die"],
    };
    let names = rigid.iter().copied().chain(sheets.iter().map(|s| s.name));
    let names: Vec<&str> = names.collect();
    let touching = touching(sheets, rigid, bag);
    let mut before: Vec<([&str; 2], usize)> = Vec::new();
    for pair in given {
        let Some(between) = pair.get("between") else {
            continue;
        };
        let [a, b] = between.items() else { continue };
        let (Some(one), Some(other)) = (a.text(), b.text()) else {
            continue;
        };
        let unknown = |n: &&Node| !names.contains(&n.text().unwrap_or_default());
        let wrong: Vec<&Node> = [a, b].into_iter().filter(unknown).collect();
        for node in &wrong {
            let name = node.text().unwrap_or_default();
            let message = format!("no surface of this scene is called `{name}`");
            let d = problems.add(source, &node.span, message);
            d.given(name).suggest(name, names.iter().copied());
        }
        if !wrong.is_empty() {
            continue;
        }
        let same = |p: &[&str; 2]| *p == [one, other] || *p == [other, one];
        let line = source.line(&between.span);
        if let Some((_, line)) = before.iter().find(|(p, _)| same(p)) {
            let message = format!("the pair of `{one}` and `{other}` is named twice");
            let d = problems.add(source, &between.span, message);
            d.given(format!("{one}, {other}"))
                .help(format!("it stands in line {line} already; remove one"));
        } else if in_order && !touching.iter().any(same) {
            let message = format!("`{one}` and `{other}` do not rub on each other in this scene");
            let d = problems.add(source, &between.span, message);
            d.given(format!("{one}, {other}"));
            let of = |p: &[&str; 2]| format!("[{}, {}]", p[0], p[1]);
            if touching.len() <= 12 {
                let all: Vec<String> = touching.iter().map(of).collect();
                d.expected(plyflow_model::manifest::one_of(
                    all.iter().map(String::as_str),
                ));
            }
            d.help("neighbours in the stack rub, its lowest and highest sheet on what is rigid, and the two films");
        }
        before.push(([one, other], line));
    }
}

/// Which surfaces rub on each other in a stack that is in order.
fn touching<'a>(sheets: &[Sheet<'a>], rigid: &[&'a str], bag: bool) -> Vec<[&'a str; 2]> {
    let (first, last) = (sheets[0].name, sheets[sheets.len() - 1].name);
    let mut found: Vec<[&str; 2]> = Vec::new();
    for name in rigid {
        // The die is the plate over the plies.
        found.push([*name, if *name == "die" { last } else { first }]);
    }
    found.extend(sheets.windows(2).map(|w| [w[0].name, w[1].name]));
    // Beyond the plies the two films meet.
    if bag && sheets.len() > 2 {
        found.push([first, last]);
    }
    // Where plies of other outlines are not, what is further apart in the stack meets.
    let plies: Vec<&Sheet<'_>> = sheets.iter().filter(|s| !s.film).collect();
    if plies.iter().any(|p| p.outline() != plies[0].outline()) {
        for (k, lower) in sheets.iter().enumerate() {
            let upper = sheets[k + 1..].iter();
            found.extend(upper.map(|upper| [lower.name, upper.name]));
        }
        if !bag {
            let all = |name: &'a str| plies.iter().map(move |ply| [name, ply.name]);
            found.extend(rigid.iter().copied().flat_map(all));
        }
    }
    found
}
