//! What was looked at for a limit.

use crate::judged::Finding;

/// What was looked at for a limit, before it is asked where that limit holds.
#[derive(Debug, Clone, Default)]
pub(crate) struct Evidence {
    /// What was found, of every size.
    pub(crate) findings: Vec<Finding>,
    /// Who has looked.
    pub(crate) by: Vec<String>,
    /// Why something has not been looked at.
    pub(crate) open: Vec<String>,
    /// What is to be known all the same.
    pub(crate) notes: Vec<String>,
}

impl Evidence {
    /// Without anybody who has looked.
    pub(crate) fn none(why: impl Into<String>) -> Self {
        Self {
            open: vec![why.into()],
            ..Self::default()
        }
    }

    /// With what another one has looked at, each text once.
    pub(crate) fn and(mut self, other: Self) -> Self {
        self.findings.extend(other.findings);
        let texts = [
            (&mut self.by, other.by),
            (&mut self.open, other.open),
            (&mut self.notes, other.notes),
        ];
        for (all, more) in texts {
            for text in more {
                if !all.contains(&text) {
                    all.push(text);
                }
            }
        }
        self
    }
}
