//! The findings of a pass in their order, each said once.

use crate::diagnostics::{Diagnostic, Diagnostics, Further, Problems};
use camino::Utf8PathBuf;
use plyflow_files::text::excerpt;

/// Further places that a message lists.
const MOST_PLACES: usize = 6;

impl Problems {
    /// Sorted by file (in the order of first mention) and place; the same finding is listed once, though several steps may read the same
    /// file. So is what is missing outside of the file, with all steps that name it.
    pub fn finish(self) -> Diagnostics {
        let mut items = together(at_places(in_order(self.items)));
        for d in &mut items {
            say_points(d);
            say_places(d);
        }
        say_folders(&mut items);
        Diagnostics { items }
    }
}

fn in_order(mut items: Vec<Diagnostic>) -> Vec<Diagnostic> {
    let mut files: Vec<Utf8PathBuf> = Vec::new();
    for d in &items {
        if !files.contains(&d.file) {
            files.push(d.file.clone());
        }
    }
    let rank = |d: &Diagnostic| files.iter().position(|f| *f == d.file);
    items.sort_by_key(|d| (rank(d), d.line, d.column));
    items
}

/// What is wrong at one place for many points is one finding, and so is what several steps find there.
fn at_places(items: Vec<Diagnostic>) -> Vec<Diagnostic> {
    let mut kept: Vec<Diagnostic> = Vec::new();
    for d in items {
        let at_place = |k: &&mut Diagnostic| {
            (&k.file, &k.span, k.line, k.column) == (&d.file, &d.span, d.line, d.column)
        };
        if d.points.is_empty() {
            let same = |k: &&mut Diagnostic| at_place(k) && k.points.is_empty() && says_same(k, &d);
            if kept.iter_mut().rev().find(same).is_none() {
                kept.push(d);
            }
            continue;
        }
        let same = |k: &&mut Diagnostic| !k.points.is_empty() && at_place(k);
        match kept.iter_mut().rev().find(same) {
            Some(known) => add_points(known, d.points),
            None => kept.push(d),
        }
    }
    kept
}

/// One finding of what is missing at several places.
fn together(items: Vec<Diagnostic>) -> Vec<Diagnostic> {
    let mut kept: Vec<Diagnostic> = Vec::new();
    for d in items {
        let same = |k: &&mut Diagnostic| d.once && k.once && k.file == d.file && says_same(k, &d);
        match kept.iter_mut().find(same) {
            Some(known) => {
                known.also.push(Further {
                    line: d.line,
                    column: d.column,
                    step: d.step.as_deref().map(str::to_owned),
                });
                add_points(known, d.points);
            }
            None => kept.push(d),
        }
    }
    kept
}

fn says_same(a: &Diagnostic, b: &Diagnostic) -> bool {
    a.severity == b.severity
        && a.message == b.message
        && (&a.given, &a.expected, &a.help, &a.searched)
            == (&b.given, &b.expected, &b.help, &b.searched)
}

fn add_points(known: &mut Diagnostic, points: Vec<String>) {
    for point in points {
        if !known.points.contains(&point) {
            known.points.push(point);
        }
    }
}

fn say_points(d: &mut Diagnostic) {
    match d.points.as_slice() {
        [] => {}
        [one] => d.message += &format!(" (at the point {})", excerpt(one, 200)),
        [one, further @ ..] => {
            d.message += &format!(
                " (at the point {}, and something here also at {} more)",
                excerpt(one, 200),
                further.len()
            );
        }
    }
}

/// Which steps want it, and where.
fn say_places(d: &mut Diagnostic) {
    if d.also.is_empty() {
        return;
    }
    let shown = d.also.len().min(MOST_PLACES);
    let place = |p: &Further| match &p.step {
        Some(step) => format!("`{step}` at {}:{}", p.line, p.column),
        None => format!("{}:{}", p.line, p.column),
    };
    let mut listed: Vec<String> = d.also[..shown].iter().map(place).collect();
    if d.also.len() > shown {
        listed.push(format!("{} more", d.also.len() - shown));
    }
    let first = d.step.as_deref().map(|s| format!("`{s}`"));
    let lead = match &first {
        Some(_) => "wanted by the steps ",
        None => "also at ",
    };
    let all: Vec<String> = first.into_iter().chain(listed).collect();
    let text = match all.as_slice() {
        [start @ .., last] if !start.is_empty() => format!("{} and {last}", start.join(", ")),
        _ => all.concat(),
    };
    d.message += &format!(" ({lead}{text})");
}

/// Lists the folders that were searched, and what is there, once.
fn say_folders(items: &mut [Diagnostic]) {
    let mut said: Vec<[String; 2]> = Vec::new();
    for d in items {
        let Some([folders, there]) = d.searched.take() else {
            continue;
        };
        let known = said.iter().any(|s| s[0] == folders);
        let told = said.iter().any(|s| s[1] == there);
        let places = match known {
            true => "searched in the same folders".to_owned(),
            false => format!("searched {folders}"),
        };
        d.help = Some(match known && told {
            true => places,
            false => format!("{places}; {there}"),
        });
        said.push([folders, there]);
    }
}
