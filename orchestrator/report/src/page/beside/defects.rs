//! The defects of two runs in one table.

use crate::beside::Pair;
use crate::judge::Found;
use crate::units::{fixed, plural};
use maud::{Markup, html};

/// Rows of the table.
const LONGEST: usize = 400;

/// How a size of a defect is told: its name with its unit, what a defect has of it (m), and its digits behind the point.
type Size = (&'static str, fn(&Found) -> Option<f64>, usize);

const SIZES: [Size; 3] = [
    ("height (mm)", |f| f.height, 2),
    ("length (mm)", |f| Some(f.length).filter(|l| *l > 0.0), 1),
    ("gap (mm)", |f| f.gap, 2),
];

pub(super) fn section(all: &[Pair]) -> Markup {
    let count = |word: &str| all.iter().filter(|p| p.word() == word).count();
    html! {
        section id="defects" {
            h2 { "Defects" }
            @if all.is_empty() {
                p { "Neither run has measured a wrinkle or bridging." }
            } @else {
                p { (plural(count("in both"), "defect is", "defects are")) " in both runs, " (count("A alone")) " in A alone, " (count("B alone")) " in B alone."
                    @if count("other kind") > 0 { " At " (plural(count("other kind"), "place", "places")) " either run has another kind of defect." } }
                p class="note" { "Defects on one ply are taken for the same where their middles in the flat ply lie within 30 mm of each other, or within half of the longer one's length. The largest come first." }
                @if all.len() > LONGEST { p class="note" { "The first " (LONGEST) " of " (all.len()) "." } }
                div class="scroll" { table {
                    thead {
                        tr { th rowspan="2" { "defect" } th rowspan="2" { "ply" } th rowspan="2" { "type" } th rowspan="2" class="n" { "x, y (mm)" } th rowspan="2" { "found" }
                            @for (name, ..) in SIZES { th class="group" colspan="3" { (name) } } }
                        tr { @for _ in SIZES { th class="n" { "A" } th class="n" { "B" } th class="n" { "change" } } }
                    }
                    tbody { @for pair in all.iter().take(LONGEST) { (row(pair)) } }
                } }
            }
        }
    }
}

/// What it is, in A and in B where that differs.
fn kinds(pair: &Pair) -> String {
    let name = |f: &Found| {
        if f.is_wrinkle() {
            "wrinkle"
        } else {
            "bridging"
        }
    };
    let mut all: Vec<&str> = pair.of.iter().flatten().map(name).collect();
    all.dedup();
    all.join(" → ")
}

/// A change with as many places as its values (SI), in mm.
fn change(value: f64, places: usize) -> String {
    let text = fixed(value * 1e3, places);
    match text.strip_prefix('-') {
        Some(size) => format!("−{size}"),
        None if text.bytes().any(|b| (b'1'..=b'9').contains(&b)) => format!("+{text}"),
        None => text,
    }
}

fn row(pair: &Pair) -> Markup {
    let any = pair.any();
    let names: Vec<&str> = pair
        .of
        .iter()
        .map(|f| f.as_ref().map_or("–", |f| f.name.as_str()))
        .collect();
    let class = match pair.word() {
        "A alone" => "met",
        "B alone" => "missed",
        _ => "",
    };
    html! { tr {
        th { (names[0]) @if names[0] != names[1] { " / " (names[1]) } } td { (any.ply) } td { (kinds(pair)) }
        td class="n" { (fixed(any.at[0] * 1e3, 0)) ", " (fixed(any.at[1] * 1e3, 0)) } td class=(class) { (pair.word()) }
        @for (_, size, places) in SIZES {
            @let both = [0, 1].map(|k| pair.of[k].as_ref().and_then(size));
            @for (k, v) in both.iter().enumerate() { td class=(if k == 0 { "n first" } else { "n" }) { (v.map_or("–".to_owned(), |v| fixed(v * 1e3, places))) } }
            td class="n" { @match both { [Some(a), Some(b)] => (change(b - a, places)), _ => "–" } }
        }
    } }
}
