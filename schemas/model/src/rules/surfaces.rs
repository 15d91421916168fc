//! Which surfaces of a scene rub on each other.

use crate::process::Process;
use crate::scene::{Sheet, SheetKind};

/// A class of two surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// Tool or bed, and a film.
    ToolDiaphragm,
    /// A part of a press, and a ply.
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

    /// Of two sheets.
    pub fn of(a: &Sheet, b: &Sheet) -> Self {
        match (a.kind, b.kind) {
            (SheetKind::Ply, SheetKind::Ply) => Self::FabricFabric,
            (SheetKind::Diaphragm, SheetKind::Diaphragm) => Self::DiaphragmDiaphragm,
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
pub fn rigid_parts(process: &Process) -> &'static [&'static str] {
    match process {
        Process::DoubleDiaphragm(_) => &["tool", "bed"],
        Process::Press(press) if press.holder.is_some() => &["tool", "die", "holder"],
        Process::Press(_) => &["tool", "die"],
    }
}

/// All contacts of a stack that is in order, from the tool upwards.
pub fn contacts<'a>(sheets: &[&'a Sheet], process: &Process) -> Vec<Contact<'a>> {
    let Some(first) = sheets.first() else {
        return Vec::new();
    };
    let contact = |lower: &'a str, upper: &'a str, class| Contact {
        parts: [lower, upper],
        class,
    };
    let mut found = Vec::new();
    match process {
        Process::DoubleDiaphragm(_) => {
            for part in rigid_parts(process) {
                found.push(contact(part, &first.name, Class::ToolDiaphragm));
            }
        }
        // Past the edges of the others any ply may touch any part.
        Process::Press(_) => {
            for part in rigid_parts(process) {
                for ply in sheets {
                    found.push(match *part {
                        // The plate over the plies.
                        "die" => contact(&ply.name, part, Class::ToolFabric),
                        _ => contact(part, &ply.name, Class::ToolFabric),
                    });
                }
            }
        }
    }
    for (k, lower) in sheets.iter().enumerate() {
        // Past the edges of what lies between them any two sheets may touch: plies slide on each other.
        for upper in &sheets[k + 1..] {
            found.push(contact(&lower.name, &upper.name, Class::of(lower, upper)));
        }
    }
    found
}
