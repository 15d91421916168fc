//! Which surfaces of a scene rub on each other.

use crate::stack::rigid::RigidName;
use plyflow_model::friction::{Coefficient, Friction};
use plyflow_model::scene::{Process, Scene, Sheet, SheetKind};

/// A class of two surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrictionClass {
    /// A rigid part and a film.
    ToolDiaphragm,
    /// A rigid part and a ply.
    ToolFabric,
    /// A ply and a film.
    FabricDiaphragm,
    /// Two plies.
    FabricFabric,
    /// Two films.
    DiaphragmDiaphragm,
}

impl FrictionClass {
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

    /// Its name in a scene.
    pub fn word(self) -> &'static str {
        match self {
            Self::ToolDiaphragm => "tool_diaphragm",
            Self::ToolFabric => "tool_fabric",
            Self::FabricDiaphragm => "fabric_diaphragm",
            Self::FabricFabric => "fabric_fabric",
            Self::DiaphragmDiaphragm => "diaphragm_diaphragm",
        }
    }

    /// What a scene gives for it.
    pub fn given(self, friction: &Friction) -> Option<&Coefficient> {
        match self {
            Self::ToolDiaphragm => friction.tool_diaphragm.as_ref(),
            Self::ToolFabric => friction.tool_fabric.as_ref(),
            Self::FabricDiaphragm => friction.fabric_diaphragm.as_ref(),
            Self::FabricFabric => friction.fabric_fabric.as_ref(),
            Self::DiaphragmDiaphragm => friction.diaphragm_diaphragm.as_ref(),
        }
    }
}

/// Two surfaces that touch, the lower one first, and their class.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Their names.
    pub parts: [String; 2],
    /// Of which class they are.
    pub class: FrictionClass,
}

impl Pair {
    fn names(&self) -> [&str; 2] {
        self.parts.each_ref().map(String::as_str)
    }
}

/// Pairs of a scene in which friction acts.
pub fn pairs(scene: &Scene) -> Vec<Pair> {
    let sheets = &scene.sheets;
    let pair = |lower: &str, upper: &str, class| Pair {
        parts: [lower.into(), upper.into()],
        class,
    };
    let (Some(first), Some(last)) = (sheets.first(), sheets.last()) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    match &scene.process {
        Process::DoubleDiaphragm(_) => {
            found.push(pair(
                RigidName::Tool.word(),
                &first.name,
                FrictionClass::ToolDiaphragm,
            ));
            found.push(pair(
                RigidName::Bed.word(),
                &first.name,
                FrictionClass::ToolDiaphragm,
            ));
        }
        Process::Press(press) => {
            found.push(pair(
                RigidName::Tool.word(),
                &first.name,
                FrictionClass::ToolFabric,
            ));
            found.push(pair(
                &last.name,
                RigidName::Die.word(),
                FrictionClass::ToolFabric,
            ));
            if press.holder.is_some() {
                found.push(pair(
                    RigidName::Holder.word(),
                    &first.name,
                    FrictionClass::ToolFabric,
                ));
            }
        }
    }
    for two in sheets.windows(2) {
        found.push(pair(
            &two[0].name,
            &two[1].name,
            FrictionClass::of(&two[0], &two[1]),
        ));
    }
    // Past the edges of what lies between them any two sheets may touch: plies slide on each other.
    for (i, lower) in sheets.iter().enumerate() {
        for upper in sheets.iter().skip(i + 2) {
            if FrictionClass::of(lower, upper) != FrictionClass::DiaphragmDiaphragm {
                found.push(pair(
                    &lower.name,
                    &upper.name,
                    FrictionClass::of(lower, upper),
                ));
            }
        }
    }
    if let Process::Press(press) = &scene.process {
        let holder = press.holder.as_ref().map(|_| RigidName::Holder);
        for part in [RigidName::Tool, RigidName::Die].into_iter().chain(holder) {
            let plies = sheets.iter().filter(|s| s.kind == SheetKind::Ply);
            let new: Vec<Pair> = (plies
                .map(|ply| pair(part.word(), &ply.name, FrictionClass::ToolFabric)))
            .filter(|p| !found.iter().any(|f| same(&f.parts, p.names())))
            .collect();
            found.extend(new);
        }
    }
    // Beyond the plies the two films meet.
    if sheets.len() > 2 && matches!(scene.process, Process::DoubleDiaphragm(_)) {
        found.push(pair(
            &first.name,
            &last.name,
            FrictionClass::of(first, last),
        ));
    }
    found
}

/// Whether two pairs of names are the same, in either order.
pub fn same(a: &[String; 2], b: [&str; 2]) -> bool {
    (a[0] == b[0] && a[1] == b[1]) || (a[0] == b[1] && a[1] == b[0])
}
