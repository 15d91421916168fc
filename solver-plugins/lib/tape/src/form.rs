//! What a tape is made of.

/// Number of an operation in its tape.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Id(pub u32);

impl Id {
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// What an operation does. `Id`s are those of earlier operations.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Operation {
    /// A number, by its bits.
    Constant(u64),
    /// A row of a buffer, as it is when the function begins.
    Load(Row),
    /// a + b.
    Add(Id, Id),
    /// a - b.
    Subtract(Id, Id),
    /// a b.
    Multiply(Id, Id),
    /// a / b.
    Divide(Id, Id),
    /// -a.
    Negate(Id),
    /// Square root.
    Root(Id),
    /// |a|.
    Magnitude(Id),
    /// `if a < b { a } else { b }`.
    Least(Id, Id),
    /// `if a > b { a } else { b }`.
    Largest(Id, Id),
    /// Truth of `a < b`.
    Less(Id, Id),
    /// `if truth { a } else { b }`.
    Select(Id, Id, Id),
    /// |a| with the sign of b.
    CopySign(Id, Id),
    /// 2^n for a = 1.5 * 2^52 + n, n whole and from -1022 to 1023.
    PowerOfTwo(Id),
    /// Place in a table: its last row whose first column is not above a, else row 0.
    Find(u16, Id),
    /// An entry of a table: table, place, column.
    Entry(u16, Id, u16),
    /// A row that a [`Call`] gives: call, buffer of its results, row.
    Result(u16, u16, u16),
}

/// A row of a buffer.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Row {
    /// Index into [`Tape::buffers`].
    pub buffer: u16,
    /// Row in it.
    pub row: u16,
}

/// Rows of numbers that a function reads, writes, or both: `[rows][lanes]`, or `[rows]` when all lanes share them.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Buffer {
    /// Name; a C identifier, and no other buffer's.
    pub name: String,
    /// Number of rows.
    pub rows: u16,
    /// Whether all lanes share one number a row (a time step).
    pub uniform: bool,
}

/// A row is written, when all has been read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Store {
    /// Where to.
    pub to: Row,
    /// What.
    pub value: Id,
}

/// Columns of a [`Table`].
pub const COLUMNS: usize = 8;

/// Numbers that are searched by their first column, which rises.
#[derive(Clone, PartialEq, Debug)]
pub struct Table {
    /// The rows: `2 stride`, or one where the stride is 0.
    pub rows: Vec<[f64; COLUMNS]>,
    /// First stride of the search, which is a power of two, or 0. It is halved after each comparison.
    pub stride: u16,
}

/// What another tape is to compute: an element's question to a material.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Call {
    /// Which one, such as `membrane`.
    pub of: String,
    /// For each of its buffers that is read: name and rows.
    pub arguments: Vec<(String, Vec<Id>)>,
    /// For each of its buffers that is written: name and number of rows.
    pub results: Vec<(String, u16)>,
}

/// A function of one lane.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Tape {
    /// The operations, each after those that it uses.
    pub operations: Vec<Operation>,
    /// What is read and written.
    pub buffers: Vec<Buffer>,
    /// What is written.
    pub stores: Vec<Store>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Questions to other tapes.
    pub calls: Vec<Call>,
}

/// What an operation gives.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind {
    Number,
    Truth,
    Place,
}

impl Operation {
    /// What it uses.
    pub(crate) fn uses(self) -> impl Iterator<Item = Id> {
        use Operation::*;
        let (a, b, c) = match self {
            Constant(_) | Load(_) | Result(..) => (None, None, None),
            Negate(a) | Root(a) | Magnitude(a) | PowerOfTwo(a) | Find(_, a) | Entry(_, a, _) => {
                (Some(a), None, None)
            }
            Add(a, b)
            | Subtract(a, b)
            | Multiply(a, b)
            | Divide(a, b)
            | Least(a, b)
            | Largest(a, b)
            | Less(a, b)
            | CopySign(a, b) => (Some(a), Some(b), None),
            Select(a, b, c) => (Some(a), Some(b), Some(c)),
        };
        [a, b, c].into_iter().flatten()
    }

    /// The same with other numbers of what it uses.
    pub(crate) fn with(self, to: impl Fn(Id) -> Id) -> Self {
        use Operation::*;
        match self {
            Constant(_) | Load(_) | Result(..) => self,
            Add(a, b) => Add(to(a), to(b)),
            Subtract(a, b) => Subtract(to(a), to(b)),
            Multiply(a, b) => Multiply(to(a), to(b)),
            Divide(a, b) => Divide(to(a), to(b)),
            Negate(a) => Negate(to(a)),
            Root(a) => Root(to(a)),
            Magnitude(a) => Magnitude(to(a)),
            Least(a, b) => Least(to(a), to(b)),
            Largest(a, b) => Largest(to(a), to(b)),
            Less(a, b) => Less(to(a), to(b)),
            Select(m, a, b) => Select(to(m), to(a), to(b)),
            CopySign(a, b) => CopySign(to(a), to(b)),
            PowerOfTwo(a) => PowerOfTwo(to(a)),
            Find(t, a) => Find(t, to(a)),
            Entry(t, a, column) => Entry(t, to(a), column),
        }
    }

    /// What it gives.
    pub(crate) fn kind(self) -> Kind {
        match self {
            Operation::Less(..) => Kind::Truth,
            Operation::Find(..) => Kind::Place,
            _ => Kind::Number,
        }
    }
}

impl Tape {
    /// How often each kind of operation stands in it, by name: what a step costs at least.
    pub fn counts(&self) -> Vec<(&'static str, usize)> {
        use Operation::*;
        let mut counts: Vec<(&'static str, usize)> = Vec::new();
        for operation in &self.operations {
            let name = match operation {
                Constant(_) => continue,
                Load(_) => "load",
                Add(..) | Subtract(..) => "add",
                Multiply(..) => "multiply",
                Divide(..) => "divide",
                Root(_) => "root",
                Negate(_) | Magnitude(_) | CopySign(..) => "sign",
                Least(..) | Largest(..) => "limit",
                Less(..) => "compare",
                Select(..) => "select",
                PowerOfTwo(_) => "power of two",
                Find(..) => "search",
                Entry(..) => "entry",
                Result(..) => "result",
            };
            match counts.iter_mut().find(|c| c.0 == name) {
                Some(c) => c.1 += 1,
                None => counts.push((name, 1)),
            }
        }
        counts.push(("store", self.stores.len()));
        counts
    }
}
