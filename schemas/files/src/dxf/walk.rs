//! The entities of a drawing, those of blocks in their places.

use super::read::{Drawing, span};
use super::unit::Unit;
use crate::flaw::Flaw;
use crate::text::shown;
use crate::turn::sin_cos;
use plyflow_model::outline::Point;
use std::ops::Range;

/// Most entities of a drawing, those of blocks counted wherever they are put.
const MOST_ENTITIES: usize = 100_000;

/// Most groups that are looked at, those of blocks counted likewise.
const MOST_LOOKED: usize = 20_000_000;

/// How deep blocks may lie in each other.
const DEEPEST: usize = 8;

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

/// The entities that were found, and how many groups were looked at.
#[derive(Default)]
pub(super) struct Walk<'t> {
    pub(super) found: Vec<Entity<'t>>,
    pub(super) looked: usize,
}

/// An entity in its place.
#[derive(Debug, Clone)]
pub(super) struct Entity<'t> {
    pub(super) kind: &'t str,
    pub(super) layer: String,
    /// The word that begins it.
    pub(super) span: Range<usize>,
    /// Its groups.
    pub(super) pairs: Range<usize>,
    /// Of a polyline: the groups of its corners.
    pub(super) corners: Vec<Range<usize>>,
    /// Into which place it is put; none: it stands as it is drawn.
    pub(super) placed: Option<Affine>,
}

/// A curve of a drawing.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    /// Its corners (m), in the order in which it is drawn.
    pub(super) points: Vec<Point>,
    /// Whether the last goes on in the first.
    pub(super) closed: bool,
    /// What it is.
    pub(super) kind: String,
    /// The word that begins it.
    pub(super) span: Range<usize>,
}

/// A map of the plane: x' = a x + b y + e, y' = c x + d y + f (m).
#[derive(Debug, Clone, Copy)]
pub(super) struct Affine([f64; 6]);

impl Affine {
    pub(super) fn of(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b, c, d, e, f] = self.0;
        [a * x + b * y + e, c * x + d * y + f]
    }

    /// Behind another one.
    pub(super) fn after(&self, first: Option<&Affine>) -> Affine {
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
    pub(super) fn scale(&self) -> f64 {
        let [a, b, c, d, ..] = self.0;
        (a * a + c * c + b * b + d * d).sqrt()
    }
}

impl<'t> Drawing<'t> {
    /// All entities of the model space, those of blocks in their places.
    pub(super) fn all(&self, unit: Unit) -> Result<Vec<Entity<'t>>, Flaw> {
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
        let turn = degrees(number(50, 0.0)?);
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

    /// Something that is wrong with an entity; the text goes on from what it is.
    pub(super) fn wrong(&self, entity: &Entity<'_>, what: &str) -> Flaw {
        let problem = format!(
            "the {} on layer `{}` {what}",
            entity.kind,
            shown(&entity.layer)
        );
        Flaw::at(entity.span.clone(), problem).help("draw it again, or put it on another layer")
    }

    /// Whether an entity is drawn as seen from below.
    ///
    /// # Errors
    /// When it is drawn in another plane.
    pub(super) fn mirrored(&self, entity: &Entity<'_>) -> Result<bool, Flaw> {
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

/// An angle (rad).
pub(super) fn degrees(angle: f64) -> f64 {
    (angle % 360.0).to_radians()
}
