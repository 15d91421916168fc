//! Warnings, sorted by what they mean: for the part, for how exact the answer is, for the run. The solver's own words are folded away.

use crate::input::ReportInput;
use crate::page::verdict;
use crate::read::Material;
use crate::units::plural;
use maud::{Markup, html};

/// What a warning is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum About {
    /// What is to be built.
    Part,
    /// How exact the answer is.
    Accuracy,
    /// How the steps ran, and what they were given.
    Run,
}

impl About {
    const ALL: [Self; 3] = [Self::Part, Self::Accuracy, Self::Run];

    fn title(self) -> &'static str {
        match self {
            Self::Part => "About the part",
            Self::Accuracy => "About how exact the answer is",
            Self::Run => "About the run",
        }
    }

    fn one(self) -> &'static str {
        match self {
            Self::Part => "warning about the part",
            Self::Accuracy => "warning about how exact the answer is",
            Self::Run => "warning about the run",
        }
    }

    fn many(self) -> &'static str {
        match self {
            Self::Part => "warnings about the part",
            Self::Accuracy => "warnings about how exact the answer is",
            Self::Run => "warnings about the run",
        }
    }
}

use About::{Accuracy, Part};

/// Words of a warning that tell what it means, and that. What has none of them is about the run, and stands in its own words.
const MEANINGS: [(&str, About, &str); 17] = [
    (
        "not draped",
        Part,
        "A part of a ply has no shape: what forms there is not known.",
    ),
    (
        "is draped on",
        Part,
        "A part of a ply has no shape: what forms there is not known.",
    ),
    (
        "have left the holder",
        Part,
        "The holder no longer holds the blank.",
    ),
    (
        "reaches the cut",
        Accuracy,
        "A defect may be larger than it is shown: it reaches the cut of its zone.",
    ),
    (
        "gone through",
        Accuracy,
        "Sheets or tool have passed through each other: the shape is wrong there.",
    ),
    (
        "deep in each other",
        Accuracy,
        "Sheets or tool are in each other: heights and gaps there are wrong by as much.",
    ),
    (
        "reach into each other",
        Accuracy,
        "Sheets or tool are in each other: heights and gaps there are wrong by as much.",
    ),
    (
        "reached into each other",
        Accuracy,
        "Sheets or tool were in each other on the way: where they slid may differ.",
    ),
    (
        "kinetic energy",
        Accuracy,
        "Inertia has moved the plies: the process ran too fast for a slow forming.",
    ),
    (
        "unaccounted for",
        Accuracy,
        "Energy is missing from the books: forces and shapes may be wrong.",
    ),
    (
        "hourglass energy",
        Accuracy,
        "Elements have deformed in ways that a mesh cannot resist: shapes are less certain where sheets fold.",
    ),
    (
        "a fibre is strained",
        Accuracy,
        "Fibres are stretched more than fibres stretch: look there before its shape is used.",
    ),
    (
        "distance field",
        Accuracy,
        "The tool as contacts see it differs from the part's.",
    ),
    (
        "scaled Jacobian",
        Accuracy,
        "Some elements of a ply's mesh are poorly shaped.",
    ),
    (
        "turns by",
        Accuracy,
        "The mesh is too coarse for the radius of a wrinkle.",
    ),
    (
        "is gone there",
        Accuracy,
        "A defect does not stay when its zone is run otherwise.",
    ),
    (
        "are gone there",
        Accuracy,
        "Defects do not stay when their zones are run otherwise.",
    ),
];

/// What a warning means.
fn meaning(text: &str) -> (About, Option<&'static str>) {
    let known = MEANINGS.iter().find(|(words, ..)| text.contains(words));
    known.map_or((About::Run, None), |(_, about, means)| {
        (*about, Some(*means))
    })
}

/// How many kinds of warnings there are of each sort, in words; empty without warnings.
pub(super) fn counts(input: &ReportInput, material: &Material) -> String {
    let warnings = verdict::warnings(input, material, false);
    let kinds = verdict::alike(&warnings);
    let count = |about: About| {
        let of = |k: &&verdict::Alike<'_>| meaning(k.said[0].1).0 == about;
        let n = kinds.iter().filter(of).count();
        (n > 0).then(|| plural(n, about.one(), about.many()))
    };
    About::ALL
        .into_iter()
        .filter_map(count)
        .collect::<Vec<_>>()
        .join(", ")
}

/// All warnings.
pub(super) fn section(input: &ReportInput, material: &Material, apart: bool) -> Markup {
    let warnings = verdict::warnings(input, material, apart);
    let kinds = verdict::alike(&warnings);
    let of = |about: About| {
        let mut groups: Vec<(Option<&str>, Vec<&verdict::Alike<'_>>)> = Vec::new();
        for kind in &kinds {
            let (own, means) = meaning(kind.said[0].1);
            if own != about {
                continue;
            }
            match groups.iter_mut().find(|(m, _)| m.is_some() && *m == means) {
                Some((_, all)) => all.push(kind),
                None => groups.push((means, vec![kind])),
            }
        }
        groups
    };
    html! {
        @if !warnings.is_empty() {
            section class="warnings" id="warnings" {
                h2 { "Warnings" }
                p class="on-paper note" { "The solvers' own words are folded under each of these in this report on the screen." }
                @for about in About::ALL {
                    @let groups = of(about);
                    @if !groups.is_empty() {
                        h3 { (about.title()) }
                        ul { @for (means, kinds) in &groups { (group(*means, kinds)) } }
                    }
                }
            }
        }
    }
}

/// Warnings of one meaning, with the solver's words folded; those without a meaning in their words.
fn group(means: Option<&str>, kinds: &[&verdict::Alike<'_>]) -> Markup {
    let said: Vec<(&str, &str)> = kinds.iter().flat_map(|k| k.said.iter().copied()).collect();
    let mut steps: Vec<&str> = Vec::new();
    for step in kinds.iter().flat_map(|k| k.steps()) {
        if !steps.contains(&step) {
            steps.push(step);
        }
    }
    let words = || html! { ul class="words" { @for (step, text) in &said { li { b { (step) } ": " (text) } } } };
    html! {
        li {
            @match means {
                Some(text) => {
                    (text) " " span class="note" { "(" (named(&steps)) ")" }
                    details { summary { "what the solver says" } (words()) }
                }
                None => {
                    b { (named(&steps)) ": " } (said[0].1)
                    @if said.len() > 1 { details { summary { "the same " (times(said.len() - 1)) " more" } (words()) } }
                }
            }
        }
    }
}

/// Steps that are named before the rest are counted.
const NAMED: usize = 4;

fn named(steps: &[&str]) -> String {
    let mut names = steps[..steps.len().min(NAMED)].join(", ");
    if steps.len() > NAMED {
        names += &format!(" and {} more", steps.len() - NAMED);
    }
    names
}

/// How often, in words.
fn times(n: usize) -> String {
    match n {
        1 => "once".into(),
        n => format!("{n} times"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_the_solver_are_sorted_by_what_they_mean_and_others_are_of_the_run() {
        for (text, about) in [
            (
                "ply 'ply_1' is not draped on 4.0 % of its area: what forms there is not known",
                About::Part,
            ),
            (
                "the plies have left the holder, which its force has pressed against the die",
                About::Part,
            ),
            (
                "CB1 reaches the cut of zone C: raise `scale`",
                About::Accuracy,
            ),
            (
                "'tool' and 'ply_1' end 0.079 mm deep in each other at (8, 2, 3) mm: 98 % of the thinner one",
                About::Accuracy,
            ),
            (
                "kinetic energy reached 7.0 % of internal energy (bound 5.0 %)",
                About::Accuracy,
            ),
            (
                "2.0 % of the external work is unaccounted for: reduce time_step",
                About::Accuracy,
            ),
            (
                "hourglass energy is 14.8 % of internal energy: refine the mesh",
                About::Accuracy,
            ),
            (
                "a fibre is strained by 1.5 %, more than 1 %",
                About::Accuracy,
            ),
            (
                "the zones cover 80 % of the blank (warning above 60 %)",
                About::Run,
            ),
            ("something that nobody has said before", About::Run),
        ] {
            assert_eq!(meaning(text).0, about, "{text}");
        }
    }
}
