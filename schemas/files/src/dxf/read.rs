//! Groups and sections of a drawing.

use super::unit::{UNITS, Unit};
use crate::flaw::Flaw;
use crate::number::{Decimal, value};
use crate::text::shown;
use std::collections::BTreeMap;
use std::ops::Range;

/// Most bytes of a drawing.
pub const MOST_DRAWN: u64 = 32 << 20;

/// A group: its code, and where its value stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    pub(super) code: i32,
    pub(super) start: u32,
    pub(super) end: u32,
}

/// A drawing.
#[derive(Debug)]
pub struct Drawing<'t> {
    text: &'t str,
    pub(super) pairs: Vec<Pair>,
    /// What `$INSUNITS` says.
    pub(super) unit: Option<i64>,
    /// Groups of the model space, and of the paper.
    pub(super) entities: Range<usize>,
    /// By name in small letters: groups of the block's head, and of what is in it.
    pub(super) blocks: BTreeMap<String, (Range<usize>, Range<usize>)>,
}

impl<'t> Drawing<'t> {
    /// Reads a drawing; `text` is what [`crate::flaw::plain`] gives of its file.
    ///
    /// # Errors
    /// The first thing that is wrong, with its place.
    pub fn read(text: &'t str) -> Result<Self, Flaw> {
        let export = "save it as DXF in text, R12 or later";
        if text.len() > MOST_DRAWN as usize {
            return Err(Flaw::whole("the drawing has more than 32 MiB")
                .help("leave out what is no outline"));
        }
        let mut read = Self {
            text,
            pairs: pairs(text).map_err(|f| f.help(export))?,
            unit: None,
            entities: 0..0,
            blocks: BTreeMap::new(),
        };
        read.sections(export)?;
        Ok(read)
    }

    pub(super) fn value(&self, pair: &Pair) -> &'t str {
        &self.text[pair.start as usize..pair.end as usize]
    }

    fn sections(&mut self, export: &str) -> Result<(), Flaw> {
        let mut found = false;
        let mut at = 0;
        while at < self.pairs.len() {
            let pair = self.pairs[at];
            let begins = pair.code == 0 && self.value(&pair) == "SECTION";
            let name = self.pairs.get(at + 1).filter(|n| begins && n.code == 2);
            let Some(name) = name.map(|n| self.value(n)) else {
                at += 1;
                continue;
            };
            let body = at + 2;
            let rest = self.pairs[body.min(self.pairs.len())..].iter();
            let ends = |p: &Pair| p.code == 0 && self.value(p) == "ENDSEC";
            let Some(length) = rest.clone().position(ends) else {
                let problem = format!(
                    "the section {} has no end: the file was cut off",
                    shown(name)
                );
                return Err(Flaw::at(span(&pair), problem).help("export it again"));
            };
            let body = body..body + length;
            at = body.end + 1;
            match name {
                "HEADER" => self.header(body),
                "BLOCKS" => self.block_section(body),
                "ENTITIES" => (self.entities, found) = (body, true),
                _ => {}
            }
        }
        match found {
            true => Ok(()),
            false => Err(Flaw::whole(
                "it has no section ENTITIES, so it is no DXF drawing, or was cut off",
            )
            .help(export)),
        }
    }

    fn header(&mut self, body: Range<usize>) {
        for k in body {
            let pair = self.pairs[k];
            if pair.code == 9 && self.value(&pair) == "$INSUNITS" {
                let next = self.pairs.get(k + 1).filter(|p| p.code == 70);
                self.unit = next.and_then(|p| self.value(p).parse().ok());
            }
        }
    }

    fn block_section(&mut self, body: Range<usize>) {
        let mut at = body.start;
        while at < body.end {
            let pair = self.pairs[at];
            at += 1;
            if pair.code != 0 || self.value(&pair) != "BLOCK" {
                continue;
            }
            let head = at..self.next_entity(at, body.end);
            let mut end = head.end;
            while end < body.end
                && !(self.pairs[end].code == 0 && self.value(&self.pairs[end]) == "ENDBLK")
            {
                end += 1;
            }
            if let Some(name) = self.word(&head, 2) {
                self.blocks
                    .insert(name.to_lowercase(), (head.clone(), head.end..end));
            }
            at = end;
        }
    }

    /// The first group with the code 0 from there on.
    pub(super) fn next_entity(&self, from: usize, end: usize) -> usize {
        let rest = &self.pairs[from.min(end)..end];
        rest.iter()
            .position(|p| p.code == 0)
            .map_or(end, |i| from + i)
    }

    /// The first value of a code.
    pub(super) fn word(&self, pairs: &Range<usize>, code: i32) -> Option<&'t str> {
        let found = self.pairs[pairs.clone()].iter().find(|p| p.code == code)?;
        Some(self.value(found))
    }

    /// The unit that the file tells.
    ///
    /// # Errors
    /// When it names one that is none of ours.
    pub fn unit(&self) -> Result<Option<Unit>, Flaw> {
        match self.unit {
            None | Some(0) => Ok(None),
            Some(code) => match UNITS.iter().find(|u| u.0 == code) {
                Some((_, symbol)) => Ok(Some(Unit::Symbol(symbol))),
                None => Err(Flaw::whole(format!("its $INSUNITS is {code}, which is no unit of a ply")).expected(
                    "1 (inches), 2 (feet), 4 (millimetres), 5 (centimetres) or 6 (metres), or `unit`, which says how long one unit of the file is",
                )),
            },
        }
    }

    /// The unit that is given, or that the file tells.
    ///
    /// # Errors
    /// When neither says it, or each says another one.
    pub fn unit_or(&self, given: Option<f64>) -> Result<Unit, Flaw> {
        if let Some(given) = given {
            let given = Unit::of(given);
            return match self.unit() {
                Ok(Some(told)) if (told.one() - given.one()).abs() > 1e-9 * told.one() => {
                    Err(Flaw::whole(format!(
                        "the drawing says that one unit of it is {told} ($INSUNITS is {}), and `unit` that it is {given}",
                        self.unit.unwrap_or_default()
                    ))
                    .expected("one unit of the file")
                    .help("leave out `unit`, or export the drawing again with $INSUNITS 0 or the right one"))
                }
                _ => Ok(given),
            };
        }
        self.unit()?.ok_or_else(|| {
            Flaw::whole("the drawing does not say what its unit is ($INSUNITS is 0 or missing)")
                .expected("`unit`, the length of one unit of it: `unit: 1 mm`, say")
        })
    }

    /// The first number of a code.
    pub(super) fn number(&self, pairs: &Range<usize>, code: i32) -> Result<Option<f64>, Flaw> {
        let found = self.pairs[pairs.clone()].iter().find(|p| p.code == code);
        found.map(|p| self.number_of(p)).transpose()
    }

    pub(super) fn number_of(&self, pair: &Pair) -> Result<f64, Flaw> {
        let text = self.value(pair);
        value(text, Decimal::Point)
            .filter(|v| v.abs() < 1e12)
            .ok_or_else(|| no_number(pair, text))
    }

    /// The first length of a code (m).
    pub(super) fn length(
        &self,
        pairs: &Range<usize>,
        code: i32,
        unit: Unit,
    ) -> Result<Option<f64>, Flaw> {
        let found = self.pairs[pairs.clone()].iter().find(|p| p.code == code);
        found.map(|p| self.length_of(p, unit)).transpose()
    }

    pub(super) fn length_of(&self, pair: &Pair, unit: Unit) -> Result<f64, Flaw> {
        let text = self.value(pair);
        unit.metres(text).ok_or_else(|| no_number(pair, text))
    }
}

pub(super) fn span(pair: &Pair) -> Range<usize> {
    pair.start as usize..pair.end as usize
}

pub(super) fn no_number(pair: &Pair, text: &str) -> Flaw {
    Flaw::at(
        span(pair),
        format!(
            "`{}` is no number that a drawing of a ply can have",
            shown(text)
        ),
    )
    .help("correct the line, or export the drawing again")
}

/// The groups of a text: pairs of lines, a code and a value.
fn pairs(text: &str) -> Result<Vec<Pair>, Flaw> {
    let mut found = Vec::new();
    let mut code: Option<i32> = None;
    let mut start = 0;
    for line in text.split('\n') {
        let value = line.trim();
        let from = start + line.len() - line.trim_start().len();
        let place = from..from + value.len();
        start += line.len() + 1;
        match code.take() {
            Some(code) => {
                found.push(Pair {
                    code,
                    start: place.start as u32,
                    end: place.end.max(place.start) as u32,
                });
                if code == 0 && value == "EOF" {
                    return Ok(found);
                }
            }
            // Behind the end.
            None if value.is_empty() && start > text.len() => {}
            None => {
                let read = value.parse().ok().filter(|c| (-10..=1100).contains(c));
                code = Some(read.ok_or_else(|| {
                    Flaw::at(
                        place,
                        format!("`{}` is no group code of a DXF drawing", shown(value)),
                    )
                    .expected("a whole number such as `10`, and the value in the line below it")
                })?);
            }
        }
    }
    match code {
        Some(_) => Err(Flaw::at(
            text.len()..text.len(),
            "the drawing ends behind a group code: it was cut off",
        )),
        None => Ok(found),
    }
}
