//! Tapes come to be, operation by operation.

use crate::form::{Buffer, COLUMNS, Call, Id, Operation, Row, Store, Table, Tape};
use crate::run;
use std::collections::HashMap;

/// A tape that is not finished. What is asked for twice is written once, and what hangs on constants alone is computed at once.
#[derive(Debug, Default)]
pub struct Builder {
    tape: Tape,
    known: HashMap<Operation, Id>,
}

impl Builder {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a buffer and gives its index.
    ///
    /// # Panics
    /// With more than 65,536 buffers.
    pub fn buffer(&mut self, name: &str, rows: u16, uniform: bool) -> u16 {
        let name = name.to_owned();
        self.tape.buffers.push(Buffer {
            name,
            rows,
            uniform,
        });
        index(self.tape.buffers.len() - 1)
    }

    /// Adds a table with the rows that the search can reach, and gives its index.
    ///
    /// # Panics
    /// When it has fewer rows than `2 stride`, or none.
    pub fn table(&mut self, rows: &[[f64; COLUMNS]], stride: usize) -> u16 {
        let rows = rows[..(2 * stride).max(1)].to_vec();
        let stride = index(stride);
        let table = Table { rows, stride };
        let same = |t: &Table| {
            let bits = |t: &Table| -> Vec<u64> {
                t.rows.as_flattened().iter().map(|x| x.to_bits()).collect()
            };
            t.stride == table.stride && bits(t) == bits(&table)
        };
        let found = self.tape.tables.iter().position(same);
        index(found.unwrap_or_else(|| {
            self.tape.tables.push(table);
            self.tape.tables.len() - 1
        }))
    }

    /// Adds a question to another tape and gives its index, for [`Operation::Result`].
    ///
    /// # Panics
    /// With more than 65,536 calls.
    pub fn call(&mut self, call: Call) -> u16 {
        self.tape.calls.push(call);
        index(self.tape.calls.len() - 1)
    }

    /// The number `x`.
    pub fn constant(&mut self, x: f64) -> Id {
        self.push(Operation::Constant(x.to_bits()))
    }

    /// Adds an operation, or finds it.
    ///
    /// # Panics
    /// With 2^32 operations.
    pub fn push(&mut self, operation: Operation) -> Id {
        if let Operation::Select(_, a, b) = operation
            && a == b
        {
            return a;
        }
        let operation = self.folded(operation).unwrap_or(operation);
        if let Some(known) = self.known.get(&operation) {
            return *known;
        }
        let id = Id(u32::try_from(self.tape.operations.len()).expect("fewer operations"));
        self.tape.operations.push(operation);
        self.known.insert(operation, id);
        id
    }

    /// Adds an operation of another tape, whose operations have the numbers `to` here. Not for results of calls.
    pub(crate) fn copy(&mut self, from: &Tape, operation: Operation, to: impl Fn(Id) -> Id) -> Id {
        let mut table = |t: u16| {
            let table = &from.tables[t as usize];
            self.table(&table.rows, table.stride as usize)
        };
        let moved = match operation {
            Operation::Find(t, a) => Operation::Find(table(t), to(a)),
            Operation::Entry(t, a, column) => Operation::Entry(table(t), to(a), column),
            other => other.with(to),
        };
        self.push(moved)
    }

    /// The constant that an operation on constants gives.
    fn folded(&self, operation: Operation) -> Option<Operation> {
        if matches!(operation, Operation::Constant(_)) {
            return None;
        }
        let value = |id: Id| match self.tape.operations[id.index()] {
            Operation::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        };
        run::arithmetic(operation, value).map(|x| Operation::Constant(x.to_bits()))
    }

    /// The tape that writes these rows, without what they do not hang on.
    pub fn finish(self, stores: impl IntoIterator<Item = (Row, Id)>) -> Tape {
        let stores = stores.into_iter();
        let stores = stores.map(|(to, value)| Store { to, value }).collect();
        Tape {
            stores,
            ..self.tape
        }
        .without_the_dead()
    }
}

/// # Panics
/// Where it does not fit.
fn index(i: usize) -> u16 {
    u16::try_from(i).expect("at most 65,536 of a kind")
}

impl Tape {
    /// Whether its stores hang on each operation.
    fn alive(&self) -> Vec<bool> {
        let mut alive = vec![false; self.operations.len()];
        let mut called = vec![false; self.calls.len()];
        for store in &self.stores {
            alive[store.value.index()] = true;
        }
        // What is used comes before: one pass backwards finds all. A call's arguments come before its results.
        for i in (0..self.operations.len()).rev() {
            if !alive[i] {
                continue;
            }
            if let Operation::Result(call, ..) = self.operations[i]
                && !std::mem::replace(&mut called[call as usize], true)
            {
                for id in self.calls[call as usize]
                    .arguments
                    .iter()
                    .flat_map(|a| &a.1)
                {
                    alive[id.index()] = true;
                }
            }
            for used in self.operations[i].uses() {
                alive[used.index()] = true;
            }
        }
        alive
    }

    /// Only what its stores hang on, in the same order. Buffers stay.
    fn without_the_dead(self) -> Self {
        let alive = self.alive();
        let mut builder = Builder {
            tape: Tape {
                buffers: self.buffers.clone(),
                ..Tape::default()
            },
            ..Builder::default()
        };
        let mut new: Vec<Option<Id>> = vec![None; self.operations.len()];
        let mut calls: Vec<Option<u16>> = vec![None; self.calls.len()];
        for (i, operation) in self
            .operations
            .iter()
            .enumerate()
            .filter(|(i, _)| alive[*i])
        {
            let to = |id: Id| new[id.index()].expect("what is used comes before");
            new[i] = Some(match *operation {
                Operation::Result(call, buffer, row) => {
                    let at = *calls[call as usize].get_or_insert_with(|| {
                        let mut moved = self.calls[call as usize].clone();
                        for id in moved.arguments.iter_mut().flat_map(|a| &mut a.1) {
                            *id = to(*id);
                        }
                        builder.call(moved)
                    });
                    builder.push(Operation::Result(at, buffer, row))
                }
                other => builder.copy(&self, other, to),
            });
        }
        let stores = self.stores.iter().map(|s| Store {
            to: s.to,
            value: new[s.value.index()].expect("what is stored is alive"),
        });
        Tape {
            stores: stores.collect(),
            ..builder.tape
        }
    }
}
