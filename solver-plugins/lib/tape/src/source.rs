//! A tape as the source of a function, which a C compiler and NVRTC read alike.

use crate::form::{Id, Kind, Operation, Tape};
use std::fmt::Write;

/// What stands before the functions of [`Tape::source`].
///
/// On a GPU the operations are those that round to nearest and are never fused (`__dadd_rn`). On a CPU the compiler must not fuse: compile
/// with `-ffp-contract=off`.
pub const PRELUDE: &str = include_str!("prelude.c");

impl Tape {
    /// A function `void name(long lanes, double *first_buffer, ..)` that does to each of `lanes` lanes what the tape says: buffers are
    /// `[rows][lanes]`, or `[rows]` where all lanes share a row. On a GPU it is a kernel, a thread a lane. [`PRELUDE`] stands before it once.
    ///
    /// # Panics
    /// When the tape has calls.
    pub fn source(&self, name: &str) -> String {
        assert!(self.calls.is_empty(), "a tape with calls has no source");
        let mut text = String::new();
        self.write_tables(name, &mut text);
        let arguments: Vec<String> = self
            .buffers
            .iter()
            .map(|b| format!("double *{}", b.name))
            .collect();
        let _ = writeln!(
            text,
            "PF_KERNEL void {name}(long lanes, {})",
            arguments.join(", ")
        );
        text.push_str("{\nPF_EACH_LANE(lanes)\n");
        for (i, operation) in self.operations.iter().enumerate() {
            if let Some(right) = self.right_side(name, *operation) {
                let kind = match operation.kind() {
                    Kind::Number => "double",
                    Kind::Truth | Kind::Place => "int",
                };
                let _ = writeln!(text, "const {kind} v{i} = {right};");
            }
        }
        for store in &self.stores {
            let (buffer, row) = (&self.buffers[store.to.buffer as usize], store.to.row);
            let value = self.operand(store.value);
            let _ = writeln!(text, "{}[{row} * lanes + lane] = {value};", buffer.name);
        }
        text.push_str("PF_END_LANE\n}\n");
        text
    }

    fn write_tables(&self, name: &str, text: &mut String) {
        for (i, table) in self.tables.iter().enumerate() {
            let _ = writeln!(text, "PF_TABLE double {name}_t{i}[][8] = {{");
            for row in &table.rows {
                // The places that a search compares with and never reaches.
                let entry = |x: &f64| {
                    number(if x.is_infinite() {
                        f64::MAX.copysign(*x)
                    } else {
                        *x
                    })
                };
                let row: Vec<String> = row.iter().map(entry).collect();
                let _ = writeln!(text, "{{{}}},", row.join(", "));
            }
            text.push_str("};\n");
        }
    }

    fn operand(&self, id: Id) -> String {
        match self.operations[id.index()] {
            Operation::Constant(bits) => number(f64::from_bits(bits)),
            _ => format!("v{}", id.0),
        }
    }

    /// None for constants, which stand where they are used.
    fn right_side(&self, name: &str, operation: Operation) -> Option<String> {
        use Operation::*;
        let v = |id: Id| self.operand(id);
        let two = |function: &str, a: Id, b: Id| format!("{function}({}, {})", v(a), v(b));
        Some(match operation {
            Constant(_) => return None,
            Load(row) => {
                let buffer = &self.buffers[row.buffer as usize];
                if buffer.uniform {
                    format!("{}[{}]", buffer.name, row.row)
                } else {
                    format!("{}[{} * lanes + lane]", buffer.name, row.row)
                }
            }
            Add(a, b) => two("PF_ADD", a, b),
            Subtract(a, b) => two("PF_SUBTRACT", a, b),
            Multiply(a, b) => two("PF_MULTIPLY", a, b),
            Divide(a, b) => two("PF_DIVIDE", a, b),
            Negate(a) => format!("-{}", v(a)),
            Root(a) => format!("PF_ROOT({})", v(a)),
            Magnitude(a) => format!("fabs({})", v(a)),
            Least(a, b) => format!("{0} < {1} ? {0} : {1}", v(a), v(b)),
            Largest(a, b) => format!("{0} > {1} ? {0} : {1}", v(a), v(b)),
            Less(a, b) => format!("{} < {}", v(a), v(b)),
            Select(truth, a, b) => format!("{} ? {} : {}", v(truth), v(a), v(b)),
            CopySign(a, b) => two("copysign", a, b),
            PowerOfTwo(a) => format!("pf_power_of_two({})", v(a)),
            Find(t, a) => {
                let stride = self.tables[t as usize].stride;
                format!("pf_find({name}_t{t}, {stride}, {})", v(a))
            }
            Entry(t, place, column) => format!("{name}_t{t}[{}][{column}]", v(place)),
            Result(..) => unreachable!("no calls"),
        })
    }
}

/// A number that reads back as the same bits: the shortest digits that do, as Rust writes them; compilers round to nearest.
fn number(x: f64) -> String {
    if !x.is_finite() {
        let bits = x.to_bits();
        return format!("pf_from_bits(0x{bits:016x}ull)");
    }
    if x.is_sign_negative() {
        format!("({x:e})")
    } else {
        format!("{x:e}")
    }
}
