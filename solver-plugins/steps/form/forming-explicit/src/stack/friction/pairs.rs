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

    /// Of two sheets, or of one and a rigid part.
    pub fn of(a: SheetKind, b: Option<SheetKind>) -> Self {
        match (a, b) {
            (SheetKind::Ply, None) => Self::ToolFabric,
            (SheetKind::Diaphragm, None) => Self::ToolDiaphragm,
            (SheetKind::Ply, Some(SheetKind::Ply)) => Self::FabricFabric,
            (SheetKind::Diaphragm, Some(SheetKind::Diaphragm)) => Self::DiaphragmDiaphragm,
            _ => Self::FabricDiaphragm,
        }
    }

    /// Its name in a scene, and what the scene gives for it.
    pub fn given(self, f: &Friction) -> (&'static str, Option<&Coefficient>) {
        let (name, given) = match self {
            Self::ToolDiaphragm => ("tool_diaphragm", &f.tool_diaphragm),
            Self::ToolFabric => ("tool_fabric", &f.tool_fabric),
            Self::FabricDiaphragm => ("fabric_diaphragm", &f.fabric_diaphragm),
            Self::FabricFabric => ("fabric_fabric", &f.fabric_fabric),
            Self::DiaphragmDiaphragm => ("diaphragm_diaphragm", &f.diaphragm_diaphragm),
        };
        (name, given.as_ref())
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
    let (Some(first), Some(last)) = (sheets.first(), sheets.last()) else {
        return Vec::new();
    };
    let two = |lower: &Sheet, upper: &Sheet| Pair {
        parts: [lower.name.clone(), upper.name.clone()],
        class: FrictionClass::of(lower.kind, Some(upper.kind)),
    };
    let on = |part: RigidName, sheet: &Sheet| Pair {
        parts: [part.word().into(), sheet.name.clone()],
        class: FrictionClass::of(sheet.kind, None),
    };
    let under = |sheet: &Sheet, part: RigidName| {
        let Pair { parts, class } = on(part, sheet);
        let [part, sheet] = parts;
        Pair {
            parts: [sheet, part],
            class,
        }
    };
    let mut found = vec![on(RigidName::Tool, first)];
    let mut rigid = vec![RigidName::Tool];
    match &scene.process {
        Process::DoubleDiaphragm(_) => found.push(on(RigidName::Bed, first)),
        Process::Press(press) => {
            found.push(under(last, RigidName::Die));
            rigid.push(RigidName::Die);
            if press.holder.is_some() {
                found.push(on(RigidName::Holder, first));
                rigid.push(RigidName::Holder);
            }
        }
    }
    found.extend(sheets.windows(2).map(|w| two(&w[0], &w[1])));
    // Past the edges of what lies between them any two sheets may touch: plies slide on each other.
    for (i, lower) in sheets.iter().enumerate() {
        let past = sheets.iter().skip(i + 2).map(|upper| two(lower, upper));
        found.extend(past.filter(|p| p.class != FrictionClass::DiaphragmDiaphragm));
    }
    match scene.process {
        Process::Press(_) => {
            let plies = || sheets.iter().filter(|s| s.kind == SheetKind::Ply);
            for pair in rigid
                .iter()
                .flat_map(|part| plies().map(|ply| on(*part, ply)))
            {
                if !found.iter().any(|f| same(&f.parts, pair.names())) {
                    found.push(pair);
                }
            }
        }
        // Beyond the plies the two films meet.
        Process::DoubleDiaphragm(_) if sheets.len() > 2 => found.push(two(first, last)),
        Process::DoubleDiaphragm(_) => {}
    }
    found
}

/// Whether two pairs of names are the same, in either order.
pub fn same(a: &[String; 2], b: [&str; 2]) -> bool {
    (a[0] == b[0] && a[1] == b[1]) || (a[0] == b[1] && a[1] == b[0])
}
