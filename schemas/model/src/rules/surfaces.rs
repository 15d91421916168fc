//! Which surfaces of a scene rub on each other.

use crate::process::Process;
use crate::scene::{Sheet, SheetKind};
use crate::stamping::Side;

/// A class of two surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Tool or bed, and a film.
    ToolDiaphragm,
    /// What is rigid, and a ply.
    ToolFabric,
    /// A ply and a film.
    FabricDiaphragm,
    /// Two plies.
    FabricFabric,
    /// Two films.
    DiaphragmDiaphragm,
}

impl Class {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::ToolDiaphragm,
        Self::ToolFabric,
        Self::FabricDiaphragm,
        Self::FabricFabric,
        Self::DiaphragmDiaphragm,
    ];

    /// Of two sheets, or of one and what is rigid.
    pub fn of(a: SheetKind, b: Option<SheetKind>) -> Self {
        match (a, b) {
            (SheetKind::Ply, None) => Self::ToolFabric,
            (SheetKind::Diaphragm, None) => Self::ToolDiaphragm,
            (SheetKind::Ply, Some(SheetKind::Ply)) => Self::FabricFabric,
            (SheetKind::Diaphragm, Some(SheetKind::Diaphragm)) => Self::DiaphragmDiaphragm,
            _ => Self::FabricDiaphragm,
        }
    }

    /// Its key in a scene's friction.
    pub fn word(self) -> &'static str {
        match self {
            Self::ToolDiaphragm => "tool_diaphragm",
            Self::ToolFabric => "tool_fabric",
            Self::FabricDiaphragm => "fabric_diaphragm",
            Self::FabricFabric => "fabric_fabric",
            Self::DiaphragmDiaphragm => "diaphragm_diaphragm",
        }
    }
}

/// Two surfaces that rub on each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Contact<'a> {
    /// Names of both, the lower one first.
    pub parts: [&'a str; 2],
    /// What they are.
    pub class: Class,
    /// Whether nothing lies between them. Further apart they touch past the edges of what does, and rub as one of the pairs between where nothing
    /// else is said.
    pub next: bool,
}

impl Contact<'_> {
    /// Whether it is that of two names, in either order.
    pub fn is_of(&self, names: [&str; 2]) -> bool {
        same_pair(self.parts, names)
    }
}

/// Whether two pairs of names are the same, in either order.
pub fn same_pair(a: [&str; 2], b: [&str; 2]) -> bool {
    a == b || a == [b[1], b[0]]
}

/// The rigid parts of a process, by the names that friction has for them.
pub fn rigid_parts(process: &Process) -> Vec<&str> {
    sides(process).into_iter().map(|(name, _)| name).collect()
}

/// The rigid parts of a process with the side of the sheets on which they are.
pub fn sides(process: &Process) -> Vec<(&str, Side)> {
    let (below, above) = (Side::Below, Side::Above);
    match process {
        Process::DoubleDiaphragm(_) => vec![("tool", below), ("bed", below)],
        Process::SingleDiaphragm(p) => {
            let bed = p.bed.then_some(("bed", below));
            [("tool", below)].into_iter().chain(bed).collect()
        }
        Process::Press(press) => {
            let holder = press.holder.as_ref().map(|_| ("holder", below));
            let parts = [("tool", below), ("die", above)];
            parts.into_iter().chain(holder).collect()
        }
        Process::Stamping(stamping) => stamping.sides(),
    }
}

/// All contacts of a stack, from the tool upwards.
pub fn contacts<'a>(sheets: &[&'a Sheet], process: &'a Process) -> Vec<Contact<'a>> {
    let last = sheets.len().saturating_sub(1);
    let bag = matches!(process, Process::DoubleDiaphragm(_));
    let single = matches!(process, Process::SingleDiaphragm(_));
    let mut found = Vec::new();
    for (part, side) in sides(process) {
        // In a press, and under a single film, any sheet may touch any part, past the edges of the others.
        for (k, sheet) in sheets
            .iter()
            .enumerate()
            .take(if bag { 1 } else { last + 1 })
        {
            let name = sheet.name.as_str();
            let over = side == Side::Above;
            found.push(Contact {
                parts: if over { [name, part] } else { [part, name] },
                class: match process {
                    Process::DoubleDiaphragm(_) => Class::ToolDiaphragm,
                    Process::SingleDiaphragm(_) => Class::of(sheet.kind, None),
                    Process::Press(_) | Process::Stamping(_) => Class::ToolFabric,
                },
                // A film reaches beyond all plies.
                next: k == if over { last } else { 0 }
                    || (single && sheet.kind == SheetKind::Diaphragm),
            });
        }
    }
    for (k, lower) in sheets.iter().enumerate() {
        // Plies slide, so that any two sheets may touch; beyond the plies the two films do.
        for (j, upper) in sheets.iter().enumerate().skip(k + 1) {
            let class = Class::of(lower.kind, Some(upper.kind));
            // A second film is refused as such, and needs no coefficient.
            if single && class == Class::DiaphragmDiaphragm {
                continue;
            }
            found.push(Contact {
                parts: [&lower.name, &upper.name],
                class,
                next: j == k + 1 || class == Class::DiaphragmDiaphragm,
            });
        }
    }
    found
}
