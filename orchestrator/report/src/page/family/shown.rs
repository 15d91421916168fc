//! What all sections of a study's page need of it.

use crate::draw::VariableAxis;
use crate::family::{Family, Levels};
use crate::input::ReportInput;
use crate::page::family::gathered::Gathered;
use crate::page::family::pictures::{MOST, Pictures};
use crate::units::{number, shown};
use maud::{Markup, html};

/// Rows of the table, and places of points.
pub(super) const LISTED: usize = 1000;
/// Of more points the marks in a plot are not links, each of which has its length.
pub(super) const LINKED: usize = 600;
/// Values that differ by no more than this part of them are the same.
pub(super) const ROUNDING: f64 = 1e-9;
/// A study with what is worked out of it once.
pub(in crate::page) struct Shown<'a> {
    pub(super) input: &'a ReportInput,
    pub(in crate::page) family: &'a Family,
    pub(super) levels: Vec<Levels>,
    pub(super) scales: Vec<VariableAxis>,
    /// Variables with more than one value.
    pub(super) varied: Vec<usize>,
    /// For each point what its steps warn of.
    pub(super) warnings: &'a [Vec<(String, String)>],
    pub(super) pictures: Option<&'a Pictures>,
}

impl<'a> Shown<'a> {
    pub(in crate::page) fn new(
        input: &'a ReportInput,
        family: &'a Family,
        gathered: &'a Gathered,
    ) -> Self {
        let levels = family.levels();
        let scales = family.variables.iter().zip(&levels);
        let scales = scales.map(|(v, l)| VariableAxis::new(v, l)).collect();
        let varied = (0..levels.len()).filter(|v| levels[*v].values.len() > 1);
        Self {
            input,
            family,
            varied: varied.collect(),
            scales,
            levels,
            warnings: &gathered.warnings,
            pictures: gathered.pictures.as_ref(),
        }
    }

    pub(super) fn values(&self, response: usize) -> Vec<Option<f64>> {
        let points = self.family.points.iter();
        points.map(|p| p.responses[response]).collect()
    }

    /// Variables that differ among the points besides some.
    pub(super) fn others(&self, than: &[usize]) -> Vec<usize> {
        let others = self.varied.iter().filter(|v| !than.contains(v));
        others.copied().collect()
    }

    pub(super) fn names(&self, variables: &[usize]) -> String {
        let names: Vec<&str> = (variables.iter())
            .map(|v| self.family.variables[*v].name.as_str())
            .collect();
        match names.as_slice() {
            [] => String::new(),
            [one] => (*one).to_owned(),
            [first @ .., last] => format!("{} and {last}", first.join(", ")),
        }
    }

    /// The address of a point's place on the page; none where there is no room for it.
    pub(super) fn address(&self, point: usize) -> Option<String> {
        let place = || format!("#{}", self.family.points[point].place());
        (point < LISTED).then(place)
    }

    /// A link to the place of a point.
    pub(super) fn link(&self, point: usize) -> Markup {
        let name = parted(&self.family.points[point].name);
        html! { a href=[self.address(point)] { (name) } }
    }
}

/// A name that may go on in the next line behind each of its values.
pub(super) fn parted(name: &str) -> Markup {
    html! { @for part in name.split_inclusive(',') { (part) wbr; } }
}

/// Smallest and largest of a response; the same where they differ by no more than rounding.
pub(super) fn range_of(values: &[Option<f64>]) -> [f64; 2] {
    let known = || values.iter().flatten().copied();
    let low = known().fold(f64::INFINITY, f64::min);
    let high = known().fold(f64::NEG_INFINITY, f64::max);
    match is_same(low, high) {
        true => [low, low],
        false => [low, high],
    }
}

pub(super) fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

/// A response as the page shows it, without its unit.
pub(super) fn cell(value: f64, unit: &str) -> String {
    number(value * shown(unit).0, 5)
}

/// How many pictures of points there are, where not all have one.
pub(super) fn pictures_note(shown: &Shown<'_>) -> Option<String> {
    let n = shown.family.points.len();
    (n > MOST).then(|| format!("Pictures are drawn of the first {MOST} of {n} points."))
}
