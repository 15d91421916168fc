//! DXF drawings in text: the curves of the model space, with those of its blocks in their places, and closed contours of them.
//!
//! Read are lines, arcs, circles, ellipses, splines and polylines, in drawings of R12 or later. Texts, dimensions, points and hatches are passed
//! over. What else lies on the layer that is asked for is refused with its line, so that no edge is left out in silence.

mod curve;
mod join;
mod spline;

use crate::flaw::Flaw;
use crate::text::shown;
use crate::turn::sin_cos;
use plyflow_model::units::{Dimension, parse_quantity};
use std::collections::BTreeMap;
use std::ops::Range;

pub use join::{Closed, Contours, nested};

/// Most bytes of a drawing.
pub const MOST_DRAWN: u64 = 32 << 20;

/// Most entities of a drawing, those of blocks counted wherever they are put.
const MOST_ENTITIES: usize = 100_000;

/// Most groups that are looked at, those of blocks counted likewise.
const MOST_LOOKED: usize = 20_000_000;

/// Most corners of all curves of a layer, before they are joined.
const MOST_POINTS: usize = 100_000;

/// How deep blocks may lie in each other.
const DEEPEST: usize = 8;

/// Symbols of units by `$INSUNITS`.
const UNITS: [(i64, &str); 10] = [
    (1, "in"),
    (2, "ft"),
    (4, "mm"),
    (5, "cm"),
    (6, "m"),
    (7, "km"),
    (13, "um"),
    (14, "dm"),
    (15, "dam"),
    (16, "hm"),
];

/// What is drawn with a pen.
const CURVES: [&str; 7] = [
    "LINE",
    "ARC",
    "CIRCLE",
    "ELLIPSE",
    "SPLINE",
    "LWPOLYLINE",
    "POLYLINE",
];

/// What is written beside, and bounds nothing.
const BESIDE: [&str; 24] = [
    "TEXT",
    "MTEXT",
    "ATTRIB",
    "ATTDEF",
    "DIMENSION",
    "ARC_DIMENSION",
    "LARGE_RADIAL_DIMENSION",
    "LEADER",
    "MLEADER",
    "MULTILEADER",
    "TOLERANCE",
    "POINT",
    "HATCH",
    "VIEWPORT",
    "SEQEND",
    "VERTEX",
    "XLINE",
    "RAY",
    "IMAGE",
    "WIPEOUT",
    "ACAD_TABLE",
    "OLEFRAME",
    "OLE2FRAME",
    "LIGHT",
];

/// How long one unit of a file is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unit {
    /// A unit that has a symbol: then a number is read as a scene would read it, to the last bit.
    Symbol(&'static str),
    /// So many metres.
    Metres(f64),
}

impl Unit {
    /// One unit of so many metres.
    pub fn of(metres: f64) -> Self {
        let named = UNITS.iter().map(|u| u.1);
        let mut same =
            named.filter(|s| parse_quantity(&format!("1 {s}"), Dimension::Length) == Ok(metres));
        same.next().map_or(Self::Metres(metres), Self::Symbol)
    }

    /// A number of the file (m); `None` where it is no finite one.
    pub fn metres(self, text: &str) -> Option<f64> {
        let plain = crate::number::plain(text, crate::number::Decimal::Point)?;
        let metres = match self {
            Self::Symbol(symbol) => {
                parse_quantity(&format!("{plain} {symbol}"), Dimension::Length).ok()?
            }
            Self::Metres(m) => m * plain.parse::<f64>().ok()?,
        };
        // No part is as large as the earth.
        (metres.abs() < 1e7).then_some(metres + 0.0)
    }

    /// One unit (m).
    pub fn one(self) -> f64 {
        self.metres("1").unwrap_or(f64::NAN)
    }
}

/// A group: its code, and where its value stands.
#[derive(Debug, Clone, Copy)]
struct Pair {
    code: i32,
    start: u32,
    end: u32,
}

/// A drawing.
#[derive(Debug)]
pub struct Drawing<'t> {
    text: &'t str,
    pairs: Vec<Pair>,
    /// What `$INSUNITS` says.
    unit: Option<i64>,
    /// Groups of the model space, and of the paper.
    entities: Range<usize>,
    /// By name in small letters: groups of the block's head, and of what is in it.
    blocks: BTreeMap<String, (Range<usize>, Range<usize>)>,
}

/// How curves become corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fineness {
    /// How far the ends of two curves may lie apart that go on in each other (m).
    pub tolerance: f64,
    /// How far a side may lie off a round curve (m).
    pub chord: f64,
}

impl Default for Fineness {
    fn default() -> Self {
        Self {
            tolerance: plyflow_model::contour::TOLERANCE.si(),
            chord: plyflow_model::contour::CHORD.si(),
        }
    }
}

/// The entities that were found, and how many groups were looked at.
#[derive(Default)]
struct Walk<'t> {
    found: Vec<Entity<'t>>,
    looked: usize,
}

/// An entity in its place.
#[derive(Debug, Clone)]
struct Entity<'t> {
    kind: &'t str,
    layer: String,
    /// The word that begins it.
    span: Range<usize>,
    /// Its groups.
    pairs: Range<usize>,
    /// Of a polyline: the groups of its corners.
    corners: Vec<Range<usize>>,
    /// Into which place it is put; none: it stands as it is drawn.
    placed: Option<Affine>,
}

/// A map of the plane: x' = a x + b y + e, y' = c x + d y + f (m).
#[derive(Debug, Clone, Copy)]
struct Affine([f64; 6]);

impl Affine {
    fn of(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b, c, d, e, f] = self.0;
        [a * x + b * y + e, c * x + d * y + f]
    }

    /// Behind another one.
    fn after(&self, first: Option<&Affine>) -> Affine {
        let Some(Affine([a, b, c, d, e, f])) = first.copied() else {
            return *self;
        };
        // What `first` puts into place lies in what `self` puts into place.
        let [o, p] = self.of([e, f]);
        let [g, h, k, l, ..] = self.0;
        Affine([
            g * a + h * c,
            g * b + h * d,
            k * a + l * c,
            k * b + l * d,
            o,
            p,
        ])
    }

    /// By how much it enlarges at most.
    fn scale(&self) -> f64 {
        let [a, b, c, d, ..] = self.0;
        (a * a + c * c + b * b + d * d).sqrt()
    }
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

    fn value(&self, pair: &Pair) -> &'t str {
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
    fn next_entity(&self, from: usize, end: usize) -> usize {
        let rest = &self.pairs[from.min(end)..end];
        rest.iter()
            .position(|p| p.code == 0)
            .map_or(end, |i| from + i)
    }

    /// The first value of a code.
    fn word(&self, pairs: &Range<usize>, code: i32) -> Option<&'t str> {
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
    /// When neither says it.
    pub fn unit_or(&self, given: Option<f64>) -> Result<Unit, Flaw> {
        if let Some(given) = given {
            return Ok(Unit::of(given));
        }
        self.unit()?.ok_or_else(|| {
            Flaw::whole("the drawing does not say what its unit is ($INSUNITS is 0 or missing)")
                .expected("`unit`, the length of one unit of it: `unit: 1 mm`, say")
        })
    }

    /// All entities of the model space, those of blocks in their places.
    fn all(&self, unit: Unit) -> Result<Vec<Entity<'t>>, Flaw> {
        let mut walk = Walk::default();
        self.within(&self.entities, (None, None, 0), unit, &mut walk)?;
        Ok(walk.found)
    }

    /// Adds the entities of some groups. `of`: the place of the block that they are in, its layer, and how deep it lies.
    fn within(
        &self,
        groups: &Range<usize>,
        of: (Option<Affine>, Option<&str>, usize),
        unit: Unit,
        walk: &mut Walk<'t>,
    ) -> Result<(), Flaw> {
        let mut at = self.next_entity(groups.start, groups.end);
        while at < groups.end {
            let pair = self.pairs[at];
            let end = self.next_entity(at + 1, groups.end);
            let own = at + 1..end;
            at = end;
            let layer = self.word(&own, 8).unwrap_or("0");
            let mut entity = Entity {
                kind: self.value(&pair),
                // What lies on layer 0 of a block is on the layer of the block.
                layer: of.1.filter(|_| layer == "0").unwrap_or(layer).to_owned(),
                span: span(&pair),
                pairs: own,
                corners: Vec::new(),
                placed: of.0,
            };
            if entity.kind == "POLYLINE" {
                while at < groups.end && self.value(&self.pairs[at]) == "VERTEX" {
                    let end = self.next_entity(at + 1, groups.end);
                    entity.corners.push(at + 1..end);
                    at = end;
                }
            }
            walk.looked += at.saturating_sub(entity.pairs.start);
            if walk.found.len() >= MOST_ENTITIES || walk.looked > MOST_LOOKED {
                let problem = format!(
                    "the drawing has more than {MOST_ENTITIES} curves, those of blocks counted wherever they are put"
                );
                let flaw = Flaw::at(entity.span, problem);
                return Err(flaw.help("leave out what is no outline"));
            }
            // 67: it is on the paper.
            if self.word(&entity.pairs, 67).is_some_and(|v| v != "0")
                || BESIDE.contains(&entity.kind)
            {
                continue;
            }
            match entity.kind {
                "INSERT" => self.insert(&entity, of.2, unit, walk)?,
                _ => walk.found.push(entity),
            }
        }
        Ok(())
    }

    /// Adds the entities of a block in its place.
    fn insert(
        &self,
        entity: &Entity<'t>,
        depth: usize,
        unit: Unit,
        walk: &mut Walk<'t>,
    ) -> Result<(), Flaw> {
        let wrong = |problem: String| Flaw::at(entity.span.clone(), problem);
        if depth >= DEEPEST {
            return Err(
                wrong(format!("blocks lie in each other more than {DEEPEST} deep"))
                    .help("explode them"),
            );
        }
        let name = self.word(&entity.pairs, 2).unwrap_or_default();
        let Some((head, body)) = self.blocks.get(&name.to_lowercase()) else {
            return Err(wrong(format!("there is no block `{}`", shown(name)))
                .help("export the drawing again, with its blocks"));
        };
        let mirrored = self.mirrored(entity)?;
        let number = |code, default| {
            self.number(&entity.pairs, code)
                .map(|v| v.unwrap_or(default))
        };
        let [columns, rows] = [number(70, 1.0)?, number(71, 1.0)?].map(|n| (n as usize).max(1));
        if columns.saturating_mul(rows) > MOST_ENTITIES {
            return Err(wrong(format!("the block is put {columns} x {rows} times"))
                .expected(format!("at most {MOST_ENTITIES} curves in all")));
        }
        let length =
            |pairs: &Range<usize>, code| self.length(pairs, code, unit).map(|v| v.unwrap_or(0.0));
        let base = [length(head, 10)?, length(head, 20)?];
        let at = [length(&entity.pairs, 10)?, length(&entity.pairs, 20)?];
        let scale = [number(41, 1.0)?, number(42, 1.0)?];
        let turn = curve::degrees(number(50, 0.0)?);
        let apart = [length(&entity.pairs, 44)?, length(&entity.pairs, 45)?];
        for k in 0..columns * rows {
            // Also of a block with nothing in it.
            walk.looked += 200;
            let step = [
                (k % columns) as f64 * apart[0],
                (k / columns) as f64 * apart[1],
            ];
            let place = placed(base, at, scale, (turn, step), mirrored);
            let place = match &entity.placed {
                Some(outer) => outer.after(Some(&place)),
                None => place,
            };
            self.within(
                body,
                (Some(place), Some(&entity.layer), depth + 1),
                unit,
                walk,
            )?;
        }
        Ok(())
    }

    /// Whether an entity is drawn as seen from below.
    ///
    /// # Errors
    /// When it is drawn in another plane.
    fn mirrored(&self, entity: &Entity<'_>) -> Result<bool, Flaw> {
        let [x, y, z] = [(210, 0.0), (220, 0.0), (230, 1.0)]
            .map(|(code, or)| self.number(&entity.pairs, code).map(|v| v.unwrap_or(or)));
        let (x, y, z) = (x?, y?, z?);
        if x.abs().max(y.abs()) > 1e-6 * z.abs() {
            let problem = format!(
                "the {} on layer `{}` does not lie in the x-y plane",
                entity.kind,
                shown(&entity.layer)
            );
            return Err(
                Flaw::at(entity.span.clone(), problem).expected("a drawing in the x-y plane")
            );
        }
        Ok(z < 0.0)
    }

    /// The first number of a code.
    fn number(&self, pairs: &Range<usize>, code: i32) -> Result<Option<f64>, Flaw> {
        let found = self.pairs[pairs.clone()].iter().find(|p| p.code == code);
        found.map(|p| self.number_of(p)).transpose()
    }

    fn number_of(&self, pair: &Pair) -> Result<f64, Flaw> {
        let text = self.value(pair);
        crate::number::value(text, crate::number::Decimal::Point)
            .filter(|v| v.abs() < 1e12)
            .ok_or_else(|| no_number(pair, text))
    }

    /// The first length of a code (m).
    fn length(&self, pairs: &Range<usize>, code: i32, unit: Unit) -> Result<Option<f64>, Flaw> {
        let found = self.pairs[pairs.clone()].iter().find(|p| p.code == code);
        found.map(|p| self.length_of(p, unit)).transpose()
    }

    fn length_of(&self, pair: &Pair, unit: Unit) -> Result<f64, Flaw> {
        let text = self.value(pair);
        unit.metres(text).ok_or_else(|| no_number(pair, text))
    }

    /// The layers that have curves, sorted, as the file spells them.
    ///
    /// # Errors
    /// As [`Drawing::contours`], where blocks cannot be put into their places.
    pub fn layers(&self) -> Result<Vec<String>, Flaw> {
        let all = self.all(Unit::Metres(1.0))?;
        let curves = all.into_iter().filter(|e| CURVES.contains(&e.kind));
        let mut layers: Vec<String> = curves.map(|e| e.layer).collect();
        layers.sort();
        layers.dedup();
        Ok(layers)
    }

    /// The closed contours of a layer (m); of the one layer that has curves, where none is given.
    ///
    /// # Errors
    /// The first thing that is wrong, with its place.
    pub fn contours(
        &self,
        layer: Option<&str>,
        unit: Unit,
        fine: Fineness,
    ) -> Result<Contours, Flaw> {
        let layers = self.layers()?;
        let there = || {
            layers
                .iter()
                .take(12)
                .map(|l| format!("`{}`", shown(l)))
                .collect::<Vec<_>>()
                .join(", ")
        };
        let same = |a: &str, b: &str| a.to_lowercase() == b.to_lowercase();
        let chosen = match (layer, layers.as_slice()) {
            (_, []) => {
                return Err(Flaw::whole("the drawing has no curve in its model space")
                    .expected(format!("some of {}", CURVES.join(", "))));
            }
            (None, [one]) => one.clone(),
            (None, all) => {
                let problem = format!("curves lie on {} layers: {}", all.len(), there());
                return Err(Flaw::whole(problem).expected("`layer`, the layer of the outline"));
            }
            (Some(layer), all) => match all.iter().find(|l| same(l, layer)) {
                Some(_) => layer.to_owned(),
                None => {
                    let problem = format!(
                        "there is no curve on the layer `{}`; curves lie on {}",
                        shown(layer),
                        there()
                    );
                    return Err(Flaw::whole(problem).expected("one of these layers"));
                }
            },
        };
        let (mut curves, mut corners) = (Vec::new(), 0);
        for entity in self.all(unit)?.iter().filter(|e| same(&e.layer, &chosen)) {
            if !CURVES.contains(&entity.kind) {
                let problem = format!(
                    "a {} on the layer `{}` is not read",
                    shown(entity.kind),
                    shown(&entity.layer)
                );
                return Err(Flaw::at(entity.span.clone(), problem)
                    .expected(format!("some of {}", CURVES.join(", ")))
                    .help("explode it, or put what is no edge on another layer"));
            }
            let curve = self.curve(entity, unit, fine.chord)?;
            corners += curve.points.len();
            if corners > MOST_POINTS {
                let problem =
                    format!("the curves of the layer have more than {MOST_POINTS} corners");
                return Err(Flaw::at(entity.span.clone(), problem)
                    .help("give a larger `chord`, or leave out what is no outline"));
            }
            curves.push(curve);
        }
        join::contours(curves, fine.tolerance)
    }
}

/// Where a block is put: moved by its base point, scaled, turned, stepped in the row and column of an array, moved to its place, and mirrored as a
/// whole where it is drawn as seen from below.
fn placed(
    base: [f64; 2],
    at: [f64; 2],
    scale: [f64; 2],
    (turn, step): (f64, [f64; 2]),
    mirrored: bool,
) -> Affine {
    let (s, c) = sin_cos(turn);
    let [a, b] = [c * scale[0], -s * scale[1]];
    let [d, e] = [s * scale[0], c * scale[1]];
    let moved = [c * step[0] - s * step[1], s * step[0] + c * step[1]];
    let x = at[0] + moved[0] - (a * base[0] + b * base[1]);
    let y = at[1] + moved[1] - (d * base[0] + e * base[1]);
    match mirrored {
        false => Affine([a, b, d, e, x, y]),
        true => Affine([-a, -b, d, e, -x, y]),
    }
}

fn span(pair: &Pair) -> Range<usize> {
    pair.start as usize..pair.end as usize
}

fn no_number(pair: &Pair, text: &str) -> Flaw {
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
