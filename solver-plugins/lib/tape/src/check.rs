//! Whether a tape keeps its rules: those of strangers may not.

use crate::form::{COLUMNS, Id, Kind, Operation, Row, Tape};
use std::fmt;

/// A rule that a tape breaks, and where.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Fault(pub String);

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Fault {}

/// Whether a name can stand in C as well: a letter, then letters, digits and `_`, at most 32.
pub(crate) fn is_identifier(name: &str) -> bool {
    let letters = name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
    let first = name.bytes().next().is_some_and(|b| b.is_ascii_alphabetic());
    letters && first && name.len() <= 32
}

impl Tape {
    /// Whether it can be run, put into another one and written as source.
    ///
    /// # Errors
    /// The first rule that it breaks: an operation that uses a later one or one of another kind, a row, table or call that is not there, a table
    /// whose size does not fit its search, a row that is written twice, a shared row that is written, a name that is none.
    pub fn check(&self) -> Result<(), Fault> {
        self.check_names()?;
        self.check_tables()?;
        for (i, operation) in self.operations.iter().enumerate() {
            self.check_operation(i, *operation)
                .map_err(|why| Fault(format!("operation {i} ({operation:?}): {why}")))?;
        }
        let mut written: Vec<Row> = Vec::with_capacity(self.stores.len());
        for store in &self.stores {
            let told = format!("store of {:?} to {:?}", store.value, store.to);
            self.check_row(store.to)
                .map_err(|why| Fault(format!("{told}: {why}")))?;
            self.check_use(store.value, self.operations.len(), Kind::Number)
                .map_err(|why| Fault(format!("{told}: {why}")))?;
            if self.buffers[store.to.buffer as usize].uniform {
                return Err(Fault(format!("{told}: all lanes share that row")));
            }
            written.push(store.to);
        }
        written.sort_unstable();
        match written.windows(2).find(|w| w[0] == w[1]) {
            Some(twice) => Err(Fault(format!("{:?} is written twice", twice[0]))),
            None => Ok(()),
        }
    }

    fn check_names(&self) -> Result<(), Fault> {
        for (i, buffer) in self.buffers.iter().enumerate() {
            let name = &buffer.name;
            if !is_identifier(name) {
                return Err(Fault(format!(
                    "buffer {i}: {name:?} is no name (a letter, then letters, digits and '_', at most 32)"
                )));
            }
            if self.buffers[..i].iter().any(|b| b.name == *name) {
                return Err(Fault(format!("buffer {i}: there is another '{name}'")));
            }
        }
        Ok(())
    }

    fn check_tables(&self) -> Result<(), Fault> {
        for (i, table) in self.tables.iter().enumerate() {
            let (stride, rows) = (table.stride as usize, table.rows.len());
            if !(stride == 0 || stride.is_power_of_two()) || rows != (2 * stride).max(1) {
                return Err(Fault(format!(
                    "table {i}: {rows} rows with a first stride of {stride}; expected a stride of 0 or a power of two, and twice as many rows (one with 0)"
                )));
            }
        }
        Ok(())
    }

    fn check_row(&self, row: Row) -> Result<(), String> {
        match self.buffers.get(row.buffer as usize) {
            None => Err(format!("there is no buffer {}", row.buffer)),
            Some(b) if row.row >= b.rows => Err(format!("'{}' has {} rows", b.name, b.rows)),
            Some(_) => Ok(()),
        }
    }

    fn check_use(&self, id: Id, before: usize, kind: Kind) -> Result<(), String> {
        if id.index() >= before {
            return Err(format!("{id:?} does not come before it"));
        }
        let given = self.operations[id.index()].kind();
        if given == kind {
            return Ok(());
        }
        Err(format!("{id:?} gives a {given:?}, not a {kind:?}"))
    }

    fn check_operation(&self, i: usize, operation: Operation) -> Result<(), String> {
        use Operation::*;
        let number = |id: Id| self.check_use(id, i, Kind::Number);
        let table = |t: u16| match self.tables.get(t as usize) {
            Some(_) => Ok(()),
            None => Err(format!("there is no table {t}")),
        };
        match operation {
            Load(row) => self.check_row(row),
            Select(truth, a, b) => {
                self.check_use(truth, i, Kind::Truth)?;
                number(a)?;
                number(b)
            }
            Find(t, a) => {
                table(t)?;
                number(a)
            }
            Entry(t, place, column) => {
                table(t)?;
                self.check_use(place, i, Kind::Place)?;
                match self.operations[place.index()] {
                    Find(other, _) if other != t => {
                        return Err(format!("{place:?} is a place in table {other}"));
                    }
                    _ => {}
                }
                if column as usize >= COLUMNS {
                    return Err(format!("a table has {} columns", COLUMNS));
                }
                Ok(())
            }
            Result(call, buffer, row) => {
                let of = self.calls.get(call as usize);
                let of = of.ok_or_else(|| format!("there is no call {call}"))?;
                for id in of.arguments.iter().flat_map(|a| &a.1) {
                    number(*id)?;
                }
                match of.results.get(buffer as usize) {
                    None => Err(format!("the call has {} results", of.results.len())),
                    Some((name, rows)) if row >= *rows => Err(format!("'{name}' has {rows} rows")),
                    Some(_) => Ok(()),
                }
            }
            other => other.uses().try_for_each(number),
        }
    }
}
