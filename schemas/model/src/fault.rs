//! What is wrong with a value: where in it, and why. Whoever has the value as a text points there; a plugin prints the sentence.

use crate::units::si_number;
use std::fmt;

/// A step of a [`Path`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Part {
    /// A key of a mapping.
    Key(String),
    /// Number of an item of a list, from 0.
    Item(usize),
}

/// A place in a value, such as `sheets[2].width`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Path(Vec<Part>);

impl Path {
    /// Of a key of the value itself.
    pub fn to(key: &str) -> Self {
        Self::default().key(key)
    }

    /// Of a key of the mapping there.
    #[must_use]
    pub fn key(&self, key: &str) -> Self {
        self.and(Part::Key(key.into()))
    }

    /// Of an item of the list there.
    #[must_use]
    pub fn item(&self, item: usize) -> Self {
        self.and(Part::Item(item))
    }

    fn and(&self, part: Part) -> Self {
        let mut parts = self.0.clone();
        parts.push(part);
        Self(parts)
    }

    /// Its steps.
    pub fn parts(&self) -> &[Part] {
        &self.0
    }

    /// The last key on it; empty without one.
    pub fn last_key(&self) -> &str {
        let keys = self.0.iter().rev().find_map(|part| match part {
            Part::Key(key) => Some(key.as_str()),
            Part::Item(_) => None,
        });
        keys.unwrap_or_default()
    }
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, part) in self.0.iter().enumerate() {
            match part {
                Part::Key(key) if k == 0 => f.write_str(key)?,
                Part::Key(key) => write!(f, ".{key}")?,
                Part::Item(item) => write!(f, "[{item}]")?,
            }
        }
        Ok(())
    }
}

/// What another place has to do with a fault.
#[derive(Debug, Clone, PartialEq)]
pub enum Other {
    /// The value there matters; as text in SI or mm for who has no text of it.
    Value(Path, String),
    /// The same stands there already.
    Same(Path),
}

/// A phrase that may speak of another place.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Phrase {
    before: String,
    other: Option<Other>,
    after: String,
}

impl Phrase {
    /// With the value at another place in it.
    pub fn with_value(before: &str, (path, text): (Path, String), after: &str) -> Self {
        Self {
            before: before.into(),
            other: Some(Other::Value(path, text)),
            after: after.into(),
        }
    }

    /// That says where the same stands.
    pub fn with_place(before: &str, path: Path, after: &str) -> Self {
        Self {
            before: before.into(),
            other: Some(Other::Same(path)),
            after: after.into(),
        }
    }

    /// With the other place as `written` has it; `None`: as the phrase itself knows it.
    pub fn written(&self, written: impl Fn(&Other) -> Option<String>) -> String {
        let other = self.other.as_ref().map(|other| {
            written(other).unwrap_or_else(|| match other {
                Other::Value(_, text) => text.clone(),
                Other::Same(path) => format!("at {path}"),
            })
        });
        format!("{}{}{}", self.before, other.unwrap_or_default(), self.after)
    }
}

impl<T: Into<String>> From<T> for Phrase {
    fn from(text: T) -> Self {
        Self {
            before: text.into(),
            ..Self::default()
        }
    }
}

impl fmt::Display for Phrase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.written(|_| None))
    }
}

/// What a scene must keep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// The order of the sheets is that of the process.
    Stack,
    /// Every sheet has a name of its own.
    Name,
    /// A sheet has the sizes of its kind.
    Size,
    /// Fibre families cross.
    Fibres,
    /// An outline bounds a region.
    Outline,
    /// A region of a ply is one, lies on it and does something.
    Region,
    /// Coefficients and laws of friction are there and make sense.
    Friction,
    /// Named pairs of surfaces rub on each other.
    Pairs,
    /// Pressures come in order, and something forms.
    Pressure,
    /// The frame holds the plies.
    Frame,
    /// Plies fit into a press and reach its plates.
    Press,
    /// What lies beside mirror planes is its own image.
    Symmetry,
    /// The tool has a surface.
    Tool,
}

/// What of a path shows a fault best.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The value there.
    Value,
    /// The key.
    Key,
    /// Nothing is there: the value of this key beside it.
    Beside(&'static str),
}

/// Why it is a fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Problem {
    /// The value itself, as text in SI or mm, is out of its bounds.
    Given(String),
    /// A sentence without its full stop.
    Text(String),
}

/// A rule that a value breaks: where, why, what is expected and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct Fault {
    /// Which.
    pub rule: Rule,
    /// Where.
    pub path: Path,
    /// What to look at there.
    pub shown: Shown,
    /// Why.
    pub problem: Problem,
    /// What was expected.
    pub expected: Option<Box<Phrase>>,
    /// What to do.
    pub help: Option<Box<Phrase>>,
}

impl Fault {
    /// Of a value, given as text, that is out of its bounds.
    pub fn given(rule: Rule, path: Path, given: impl Into<String>) -> Self {
        Self::new(rule, path, Problem::Given(given.into()))
    }

    /// Told by a sentence.
    pub fn text(rule: Rule, path: Path, text: impl Into<String>) -> Self {
        Self::new(rule, path, Problem::Text(text.into()))
    }

    fn new(rule: Rule, path: Path, problem: Problem) -> Self {
        Self {
            rule,
            path,
            shown: Shown::Value,
            problem,
            expected: None,
            help: None,
        }
    }

    /// States what was expected.
    #[must_use]
    pub fn expected(mut self, text: impl Into<Phrase>) -> Self {
        self.expected = Some(Box::new(text.into()));
        self
    }

    /// States the remedy.
    #[must_use]
    pub fn help(mut self, text: impl Into<Phrase>) -> Self {
        self.help = Some(Box::new(text.into()));
        self
    }

    /// The same at another place.
    #[must_use]
    pub fn at(mut self, path: Path) -> Self {
        self.path = path;
        self
    }

    /// Is to be shown there.
    #[must_use]
    pub fn shown(mut self, shown: Shown) -> Self {
        self.shown = shown;
        self
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.problem {
            Problem::Given(given) => write!(f, "{}: given {given}", self.path)?,
            Problem::Text(text) => write!(f, "{}: {text}", self.path)?,
        }
        if let Some(expected) = &self.expected {
            write!(f, "; expected {expected}")?;
        }
        match &self.help {
            Some(help) => write!(f, " ({help})"),
            None => Ok(()),
        }
    }
}

impl From<Fault> for String {
    fn from(fault: Fault) -> Self {
        fault.to_string()
    }
}

/// A length (m) as text in mm, rounded to 0.001 mm.
pub fn mm(metres: f64) -> String {
    format!("{} mm", si_number((metres * 1e6).round() / 1e3 + 0.0))
}

/// A pressure (Pa) as text in bar, rounded to 0.1 Pa.
pub fn bar(pascals: f64) -> String {
    format!("{} bar", si_number((pascals * 10.0).round() / 1e6 + 0.0))
}

/// An angle (rad) as text in deg, rounded to 0.001 deg.
pub fn degrees(radians: f64) -> String {
    format!(
        "{} deg",
        si_number((radians.to_degrees() * 1e3).round() / 1e3 + 0.0)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_prints_its_place_and_another_place_as_the_caller_knows_it() {
        let path = Path::to("sheets").item(2).key("width");
        let other = Path::to("sheets").item(0).key("width");
        let fault = Fault::given(Rule::Size, path, mm(-0.0123456))
            .expected(Phrase::with_value(
                "more than ",
                (other.clone(), mm(0.1)),
                "",
            ))
            .help(Phrase::with_place("it stands ", other, " already"));
        assert_eq!(
            fault.to_string(),
            "sheets[2].width: given -12.346 mm; expected more than 100 mm (it stands at sheets[0].width already)"
        );
        let help = fault.help.unwrap().written(|_| Some("in line 3".into()));
        assert_eq!(help, "it stands in line 3 already");
        assert_eq!(
            [bar(7e5), bar(1234.5), degrees(1.0)].join(" "),
            "7 bar 0.012345 bar 57.296 deg"
        );
    }
}
