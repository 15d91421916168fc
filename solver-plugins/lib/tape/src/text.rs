//! Tapes as text, which a program in any language writes and a person reads.
//!
//! ```text
//! plyflow-tape 1
//! buffer metric 3
//! buffer dt 1 uniform
//! buffer stress 3
//! c11 = load metric 0
//! green = subtract c11 1
//! half = multiply 0.5 green
//! s11 = multiply 4e5 half
//! store stress 0 s11
//! ```
//!
//! A line a statement; what follows a `#` is for people. Names are letters, digits and `_`, begin with a letter, and are given once. Where a number is
//! wanted, one may stand in the place of a name: decimal (read to the nearest double) or by its bits (`0x3ff0000000000000`).
//!
//! | statement | |
//! |---|---|
//! | `buffer NAME ROWS`, `buffer NAME ROWS uniform` | what is read or written |
//! | `NAME = load BUFFER ROW` | |
//! | `NAME = add A B`, `subtract`, `multiply`, `divide`, `least`, `largest`, `copysign` | |
//! | `NAME = negate A`, `root`, `magnitude`, `power_of_two` | |
//! | `NAME = less A B`, `NAME = select TRUTH A B` | |
//! | `table NAME STRIDE`, then `row X0 .. X7` for each of its rows | a table |
//! | `NAME = find TABLE A`, `NAME = entry TABLE PLACE COLUMN` | |
//! | `call NAME OF`, then `argument BUFFER A B ..` and `result BUFFER ROWS` | a question to another tape |
//! | `NAME = result CALL BUFFER ROW` | |
//! | `store BUFFER ROW A` | |

use crate::build::Builder;
use crate::check::{Fault, is_identifier};
use crate::form::{COLUMNS, Call, Id, Kind, Operation, Row, Tape};
use std::collections::HashMap;
use std::fmt::{self, Write};

/// The first line.
const HEAD: &str = "plyflow-tape 1";
/// Most bytes of a text that is read: the largest of Plyflow's own tapes takes 60,000.
const MOST: usize = 16 << 20;
/// Most buffers, tables and calls: Plyflow's own have nine, two and four.
const MOST_OF_A_KIND: usize = 1000;

impl fmt::Display for Tape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{HEAD}")?;
        for b in &self.buffers {
            let uniform = if b.uniform { " uniform" } else { "" };
            writeln!(f, "buffer {} {}{uniform}", b.name, b.rows)?;
        }
        for (i, table) in self.tables.iter().enumerate() {
            writeln!(f, "table t{i} {}", table.stride)?;
            for row in &table.rows {
                let row: Vec<String> = row.iter().map(|x| number(*x)).collect();
                writeln!(f, "row {}", row.join(" "))?;
            }
        }
        let said = Said::new(self);
        let mut called = vec![false; self.calls.len()];
        for (i, operation) in self.operations.iter().enumerate() {
            if let Operation::Result(call, ..) = *operation
                && !std::mem::replace(&mut called[call as usize], true)
            {
                said.write_call(call as usize, f)?;
            }
            if let Some(right) = said.statement(*operation) {
                writeln!(f, "v{} = {right}", said.numbers[i])?;
            }
        }
        for s in &self.stores {
            let name = &self.buffers[s.to.buffer as usize].name;
            writeln!(f, "store {name} {} {}", s.to.row, said.word_of(s.value))?;
        }
        Ok(())
    }
}

/// A number that reads back as the same bits.
fn number(x: f64) -> String {
    if x.is_finite() {
        format!("{x:e}")
    } else {
        format!("0x{:016x}", x.to_bits())
    }
}

/// A tape whose operations have numbers without those of the constants, which stand where they are used.
struct Said<'t> {
    tape: &'t Tape,
    numbers: Vec<usize>,
}

impl<'t> Said<'t> {
    fn new(tape: &'t Tape) -> Self {
        let mut next = 0;
        let number = |operation: &Operation| {
            let number = next;
            next += usize::from(!matches!(operation, Operation::Constant(_)));
            number
        };
        let numbers = tape.operations.iter().map(number).collect();
        Self { tape, numbers }
    }

    fn word_of(&self, id: Id) -> String {
        match self.tape.operations[id.index()] {
            Operation::Constant(bits) => number(f64::from_bits(bits)),
            _ => format!("v{}", self.numbers[id.index()]),
        }
    }

    fn write_call(&self, i: usize, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let call = &self.tape.calls[i];
        writeln!(f, "call c{i} {}", call.of)?;
        for (name, ids) in &call.arguments {
            let ids: Vec<String> = ids.iter().map(|id| self.word_of(*id)).collect();
            writeln!(f, "argument {name} {}", ids.join(" "))?;
        }
        for (name, rows) in &call.results {
            writeln!(f, "result {name} {rows}")?;
        }
        Ok(())
    }

    /// None for constants, which stand where they are used.
    fn statement(&self, operation: Operation) -> Option<String> {
        let mut text = match operation {
            Operation::Constant(_) => return None,
            Operation::Load(at) => {
                format!(
                    "load {} {}",
                    self.tape.buffers[at.buffer as usize].name, at.row
                )
            }
            Operation::Find(table, _) => format!("find t{table}"),
            Operation::Entry(table, ..) => format!("entry t{table}"),
            Operation::Result(call, buffer, row) => {
                let name = &self.tape.calls[call as usize].results[buffer as usize].0;
                format!("result c{call} {name} {row}")
            }
            other => word(other).to_owned(),
        };
        for id in operation.uses() {
            let _ = write!(text, " {}", self.word_of(id));
        }
        if let Operation::Entry(_, _, column) = operation {
            let _ = write!(text, " {column}");
        }
        Some(text)
    }
}

/// The word of an operation on numbers.
fn word(operation: Operation) -> &'static str {
    use Operation::*;
    match operation {
        Add(..) => "add",
        Subtract(..) => "subtract",
        Multiply(..) => "multiply",
        Divide(..) => "divide",
        Negate(_) => "negate",
        Root(_) => "root",
        Magnitude(_) => "magnitude",
        Least(..) => "least",
        Largest(..) => "largest",
        Less(..) => "less",
        Select(..) => "select",
        CopySign(..) => "copysign",
        PowerOfTwo(_) => "power_of_two",
        Constant(_) | Load(_) | Find(..) | Entry(..) | Result(..) => "",
    }
}

/// The operation of a word, from the places of what it uses.
fn operation(word: &str, ids: &[Id]) -> Option<Operation> {
    use Operation::*;
    Some(match (word, ids) {
        ("add", &[a, b]) => Add(a, b),
        ("subtract", &[a, b]) => Subtract(a, b),
        ("multiply", &[a, b]) => Multiply(a, b),
        ("divide", &[a, b]) => Divide(a, b),
        ("negate", &[a]) => Negate(a),
        ("root", &[a]) => Root(a),
        ("magnitude", &[a]) => Magnitude(a),
        ("least", &[a, b]) => Least(a, b),
        ("largest", &[a, b]) => Largest(a, b),
        ("less", &[a, b]) => Less(a, b),
        ("select", &[m, a, b]) => Select(m, a, b),
        ("copysign", &[a, b]) => CopySign(a, b),
        ("power_of_two", &[a]) => PowerOfTwo(a),
        _ => return None,
    })
}

/// A text that is being read.
#[derive(Default)]
struct Reader<'t> {
    builder: Builder,
    /// What names stand for, and of which kind it is.
    values: HashMap<&'t str, (Id, Kind)>,
    buffers: Vec<(&'t str, u16)>,
    tables: Vec<(&'t str, usize, Vec<[f64; COLUMNS]>)>,
    calls: Vec<(&'t str, Call)>,
    /// Indices of tables and calls in the builder, once they are whole.
    made_tables: HashMap<usize, u16>,
    made_calls: HashMap<usize, u16>,
    stores: Vec<(Row, Id)>,
}

impl Tape {
    /// Reads a tape.
    ///
    /// # Errors
    /// The line that is wrong, what stands there and what was expected, or a rule that the whole breaks ([`Tape::check`]).
    pub fn read(text: &str) -> Result<Self, Fault> {
        if text.len() > MOST {
            return Err(Fault(format!(
                "{} bytes; a tape has at most {MOST}",
                text.len()
            )));
        }
        let mut lines = text.lines().enumerate();
        match lines.next() {
            Some((_, first)) if first.trim() == HEAD => {}
            _ => return Err(Fault(format!("line 1: expected '{HEAD}'"))),
        }
        let mut reader = Reader::default();
        for (i, line) in lines {
            let line = line.split('#').next().unwrap_or_default();
            let words: Vec<&str> = line.split_whitespace().collect();
            if !words.is_empty() {
                reader
                    .line(&words)
                    .map_err(|why| Fault(format!("line {}: {why}", i + 1)))?;
            }
        }
        let tape = reader.builder.finish(reader.stores);
        tape.check()?;
        Ok(tape)
    }
}

fn whole(word: &str, what: &str) -> Result<u16, String> {
    word.parse()
        .map_err(|_| format!("'{}' is no {what} (0 to 65535)", short(word)))
}

/// Whether there may be one more.
fn room(so_far: usize, what: &str) -> Result<(), String> {
    if so_far < MOST_OF_A_KIND {
        return Ok(());
    }
    Err(format!("more than {MOST_OF_A_KIND} {what}"))
}

/// A word of a stranger in a message: not long, and nothing that a terminal obeys.
fn short(word: &str) -> String {
    let shown: String = word
        .chars()
        .take(40)
        .map(|c| if c.is_control() { '?' } else { c })
        .collect();
    if shown.len() < word.len() {
        format!("{shown}..")
    } else {
        shown
    }
}

/// Whether a word may name something: all that messages repeat of a tape.
fn is_name(word: &str) -> Result<(), String> {
    if is_identifier(word) {
        return Ok(());
    }
    Err(format!(
        "'{}' is no name (a letter, then letters, digits and '_', at most 32)",
        short(word)
    ))
}

fn read_number(word: &str) -> Option<f64> {
    match word.strip_prefix("0x") {
        Some(bits) if bits.len() == 16 => u64::from_str_radix(bits, 16).ok().map(f64::from_bits),
        Some(_) => None,
        // Not the words that Rust takes for numbers too.
        None => word
            .bytes()
            .next()
            .filter(|b| b.is_ascii_digit() || *b == b'-' || *b == b'.')
            .and_then(|_| word.parse().ok()),
    }
}

impl<'t> Reader<'t> {
    fn line(&mut self, words: &[&'t str]) -> Result<(), String> {
        match *words {
            ["buffer", name, rows] => self.buffer(name, rows, false),
            ["buffer", name, rows, "uniform"] => self.buffer(name, rows, true),
            ["table", name, stride] => {
                self.new_name(name)?;
                room(self.tables.len(), "tables")?;
                self.tables
                    .push((name, whole(stride, "stride")?.into(), Vec::new()));
                Ok(())
            }
            ["row", ref numbers @ ..] => self.row(numbers),
            ["call", name, of] => {
                self.new_name(name)?;
                room(self.calls.len(), "calls")?;
                is_name(of)?;
                let of = of.to_owned();
                let (arguments, results) = (Vec::new(), Vec::new());
                self.calls.push((
                    name,
                    Call {
                        of,
                        arguments,
                        results,
                    },
                ));
                Ok(())
            }
            ["argument", name, ref ids @ ..] => {
                is_name(name)?;
                let ids: Result<Vec<Id>, String> = ids.iter().map(|w| self.number(w)).collect();
                let ids = ids?;
                self.open_call()?.arguments.push((name.to_owned(), ids));
                Ok(())
            }
            ["result", name, rows] => {
                is_name(name)?;
                let rows = whole(rows, "number of rows")?;
                self.open_call()?.results.push((name.to_owned(), rows));
                Ok(())
            }
            ["store", buffer, row, value] => {
                let (to, value) = (self.place(buffer, row)?, self.number(value)?);
                self.stores.push((to, value));
                Ok(())
            }
            [name, "=", word, ref rest @ ..] => {
                self.new_name(name)?;
                let operation = self.operation(word, rest)?;
                let kind = operation.kind();
                let id = self.builder.push(operation);
                self.values.insert(name, (id, kind));
                Ok(())
            }
            _ => Err(format!(
                "'{}' begins no statement, or one with other words",
                short(words[0])
            )),
        }
    }

    fn new_name(&self, name: &str) -> Result<(), String> {
        is_name(name)?;
        let taken = self.values.contains_key(name)
            || self.tables.iter().any(|t| t.0 == name)
            || self.calls.iter().any(|c| c.0 == name);
        if taken {
            Err(format!("there is another '{}'", short(name)))
        } else {
            Ok(())
        }
    }

    fn buffer(&mut self, name: &'t str, rows: &str, uniform: bool) -> Result<(), String> {
        room(self.buffers.len(), "buffers")?;
        is_name(name)?;
        let index = self
            .builder
            .buffer(name, whole(rows, "number of rows")?, uniform);
        self.buffers.push((name, index));
        Ok(())
    }

    fn row(&mut self, words: &[&str]) -> Result<(), String> {
        let numbers: Option<Vec<f64>> = words.iter().map(|w| read_number(w)).collect();
        let numbers = numbers.and_then(|n| <[f64; COLUMNS]>::try_from(n).ok());
        let numbers = numbers.ok_or_else(|| format!("expected {COLUMNS} numbers after 'row'"))?;
        let (_, stride, rows) = self.tables.last_mut().ok_or("a 'row' before any 'table'")?;
        if rows.len() >= (2 * *stride).max(1) {
            return Err(format!(
                "a table with the stride {stride} has {} rows",
                (2 * *stride).max(1)
            ));
        }
        rows.push(numbers);
        Ok(())
    }

    /// The last call, which is not asked yet.
    fn open_call(&mut self) -> Result<&mut Call, String> {
        let last = self
            .calls
            .len()
            .checked_sub(1)
            .ok_or("there is no 'call' before")?;
        if self.made_calls.contains_key(&last) {
            return Err(
                "what a call takes and gives stands before its first result is used".into(),
            );
        }
        Ok(&mut self.calls[last].1)
    }

    fn place(&self, buffer: &str, row: &str) -> Result<Row, String> {
        let found = self.buffers.iter().find(|b| b.0 == buffer);
        let (_, buffer) = found.ok_or_else(|| format!("there is no buffer '{}'", short(buffer)))?;
        Ok(Row {
            buffer: *buffer,
            row: whole(row, "row")?,
        })
    }

    fn value(&self, word: &str) -> Option<(Id, Kind)> {
        self.values.get(word).copied()
    }

    /// A number by name, or itself.
    fn number(&mut self, word: &str) -> Result<Id, String> {
        if let Some((id, Kind::Number)) = self.value(word) {
            return Ok(id);
        }
        let value = read_number(word)
            .ok_or_else(|| format!("'{}' is no number, nor the name of one before", short(word)))?;
        Ok(self.builder.constant(value))
    }

    fn operation(&mut self, word: &str, rest: &[&'t str]) -> Result<Operation, String> {
        match (word, rest) {
            ("load", [buffer, row]) => Ok(Operation::Load(self.place(buffer, row)?)),
            ("find", [table, a]) => {
                let (table, a) = (self.table(table)?, self.number(a)?);
                Ok(Operation::Find(table, a))
            }
            ("entry", [table, place, column]) => {
                let found = self.value(place).filter(|v| v.1 == Kind::Place);
                let (place, _) = found
                    .ok_or_else(|| format!("'{}' is no place that was found", short(place)))?;
                Ok(Operation::Entry(
                    self.table(table)?,
                    place,
                    whole(column, "column")?,
                ))
            }
            ("result", [call, buffer, row]) => {
                let at = self.calls.iter().position(|c| c.0 == *call);
                let at = at.ok_or_else(|| format!("there is no call '{}'", short(call)))?;
                let results = &self.calls[at].1.results;
                let index = results.iter().position(|r| r.0 == *buffer);
                let index =
                    index.ok_or_else(|| format!("the call does not give '{}'", short(buffer)))?;
                let row = whole(row, "row")?;
                let (builder, asked) = (&mut self.builder, &self.calls[at].1);
                let made = *self
                    .made_calls
                    .entry(at)
                    .or_insert_with(|| builder.call(asked.clone()));
                Ok(Operation::Result(made, index as u16, row))
            }
            ("select", [truth, a, b]) => {
                let found = self.value(truth).filter(|v| v.1 == Kind::Truth);
                let (truth, _) = found
                    .ok_or_else(|| format!("'{}' is no truth ('less' gives one)", short(truth)))?;
                Ok(Operation::Select(truth, self.number(a)?, self.number(b)?))
            }
            _ => {
                let ids: Result<Vec<Id>, String> = rest.iter().map(|w| self.number(w)).collect();
                operation(word, &ids?).ok_or_else(|| {
                    format!(
                        "'{}' with {} operands is no operation",
                        short(word),
                        rest.len()
                    )
                })
            }
        }
    }

    fn table(&mut self, name: &str) -> Result<u16, String> {
        let at = self.tables.iter().position(|t| t.0 == name);
        let at = at.ok_or_else(|| format!("there is no table '{}'", short(name)))?;
        let (_, stride, rows) = &self.tables[at];
        let wanted = (2 * stride).max(1);
        if rows.len() != wanted || !(*stride == 0 || stride.is_power_of_two()) {
            return Err(format!(
                "table '{}' has {} rows and the stride {stride}; expected a stride of 0 or a power of two, and {wanted} rows",
                short(name),
                rows.len()
            ));
        }
        let (builder, tables) = (&mut self.builder, &self.tables);
        Ok(*self
            .made_tables
            .entry(at)
            .or_insert_with(|| builder.table(&tables[at].2, tables[at].1)))
    }
}
