//! Everything that is on a page, read and ready to be written.

use crate::draw::DrawError;
use crate::input::ReportInput;
use crate::page::carried::{self, Shown};
use crate::page::family::gathered::Gathered;
use crate::read::Material;

/// Everything that is on a page.
#[derive(Debug)]
pub(crate) struct Content<'a> {
    pub(super) input: &'a ReportInput,
    /// What artifacts say, of what is shown besides a study.
    pub(super) material: Material,
    /// Steps with plots, files or numbers of their own.
    pub(super) shown: Vec<Shown>,
    /// What was read of a study.
    pub(super) study: Option<Gathered>,
}

impl<'a> Content<'a> {
    /// Reads all that a page has. What cannot be read is among its warnings.
    ///
    /// # Errors
    /// When a picture cannot be encoded.
    pub(crate) fn read(input: &'a ReportInput) -> Result<Self, DrawError> {
        let family = input.family.as_ref();
        let study = family.map(|f| Gathered::of(input, f)).transpose()?;
        let rest = study.as_ref().map_or(input, |s| s.rest(input));
        let mut material = Material::read(rest, true);
        let shown = carried::read(rest, &material.facts, &mut material.problems);
        if let Some(study) = &study {
            material.problems.extend(study.problems.iter().cloned());
        }
        Ok(Self {
            input,
            material,
            shown,
            study,
        })
    }

    /// Adds a warning of the report itself.
    pub(crate) fn warn(&mut self, text: String) {
        self.material.problems.push(text);
    }

    /// What is shown of steps besides the study.
    pub(super) fn rest(&self) -> &ReportInput {
        let study = self.study.as_ref();
        study.map_or(self.input, |s| s.rest(self.input))
    }
}
