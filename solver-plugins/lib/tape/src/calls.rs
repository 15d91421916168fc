//! One tape goes into another: a material into the element that asks it.

use crate::build::Builder;
use crate::check::Fault;
use crate::form::{Call, Id, Operation, Row, Tape};

impl Tape {
    /// The same with every call replaced by what `of` gives for its name. Buffers of the two meet by their names. A row that is an argument and a
    /// result and that the callee does not write (a history that stays) is as it was.
    ///
    /// # Errors
    /// When there is no tape for a call, or one reads or writes what the call does not have.
    pub fn with_calls<'t>(&self, of: impl Fn(&str) -> Option<&'t Tape>) -> Result<Self, Fault> {
        let mut builder = Builder::new();
        for b in &self.buffers {
            builder.buffer(&b.name, b.rows, b.uniform);
        }
        let mut new: Vec<Id> = Vec::with_capacity(self.operations.len());
        let mut answers: Vec<Option<Vec<Vec<Id>>>> = vec![None; self.calls.len()];
        for operation in &self.operations {
            let to = |id: Id| new[id.index()];
            let id = match *operation {
                Operation::Result(c, buffer, row) => {
                    let call = &self.calls[c as usize];
                    if answers[c as usize].is_none() {
                        let tape = of(&call.of)
                            .ok_or_else(|| Fault(format!("there is no tape for '{}'", call.of)))?;
                        let answer = tape.answer(call, to, &mut builder);
                        let answer =
                            answer.map_err(|why| Fault(format!("'{}': {why}", call.of)))?;
                        answers[c as usize] = Some(answer);
                    }
                    let answer = answers[c as usize].as_ref().expect("just made");
                    answer[buffer as usize][row as usize]
                }
                other => builder.copy(self, other, to),
            };
            new.push(id);
        }
        let stores: Vec<(Row, Id)> = self
            .stores
            .iter()
            .map(|s| (s.to, new[s.value.index()]))
            .collect();
        Ok(builder.finish(stores))
    }

    /// What it answers to a call, by buffer and row of its results, written into `builder`; `to`: where the arguments are there.
    fn answer(
        &self,
        call: &Call,
        to: impl Fn(Id) -> Id,
        builder: &mut Builder,
    ) -> Result<Vec<Vec<Id>>, String> {
        if let Some(inner) = self.calls.first() {
            return Err(format!("it calls '{}' itself", inner.of));
        }
        let argument = |name: &str, row: u16| {
            let (_, rows) = call.arguments.iter().find(|a| a.0 == name)?;
            rows.get(row as usize).map(|id| to(*id))
        };
        let mut new: Vec<Id> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let own = |id: Id| new[id.index()];
            let id = match *operation {
                Operation::Load(at) => {
                    let name = &self.buffers[at.buffer as usize].name;
                    argument(name, at.row).ok_or_else(|| {
                        format!("it reads row {} of '{name}', which it is not given", at.row)
                    })?
                }
                other => builder.copy(self, other, own),
            };
            new.push(id);
        }
        let written = |name: &str, row: u16| {
            let store = self
                .stores
                .iter()
                .find(|s| s.to.row == row && self.buffers[s.to.buffer as usize].name == name)?;
            Some(new[store.value.index()])
        };
        let row_of = |name: &str, row: u16| {
            written(name, row)
                .or_else(|| argument(name, row))
                .ok_or_else(|| format!("it does not write row {row} of '{name}'"))
        };
        let results = call.results.iter();
        results
            .map(|(name, rows)| (0..*rows).map(|row| row_of(name, row)).collect())
            .collect()
    }
}
