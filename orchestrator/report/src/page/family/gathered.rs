//! What is read and drawn of a study before its page is written.

use crate::draw::DrawError;
use crate::family::{Family, Point};
use crate::input::{Instance, ReportInput};
use crate::page::family::pictures::{self, Pictures};
use crate::read::Facts;

/// What is read of a study for its page.
#[derive(Debug, Default)]
pub(crate) struct Gathered {
    /// For each point what its steps warn of: label and text.
    pub(super) warnings: Vec<Vec<(String, String)>>,
    /// Small pictures of the formed plies, if there are plies.
    pub(super) pictures: Option<Pictures>,
    /// What could not be read.
    pub(in crate::page) problems: Vec<String>,
    /// What is the same at every point, where what is of one point finds no room.
    rest: Option<ReportInput>,
}

impl Gathered {
    /// # Errors
    /// When a picture cannot be encoded.
    pub(in crate::page) fn of(input: &ReportInput, family: &Family) -> Result<Self, DrawError> {
        let all: Vec<Vec<String>> = input.instances.iter().map(warnings).collect();
        let of_point = |p: &Point| {
            let one = |i: &usize| {
                let label = input.instances[*i].label();
                all[*i]
                    .iter()
                    .map(move |text| (label.clone(), text.clone()))
            };
            p.instances.iter().flat_map(one).collect()
        };
        let mut problems = Vec::new();
        Ok(Self {
            warnings: family.points.iter().map(of_point).collect(),
            pictures: pictures::draw(input, family, &mut problems)?,
            problems,
            rest: family.is_large().then(|| input.shared(family)),
        })
    }

    /// What is shown of steps besides the study.
    pub(in crate::page) fn rest<'a>(&'a self, input: &'a ReportInput) -> &'a ReportInput {
        self.rest.as_ref().unwrap_or(input)
    }
}

/// What a step warns of, in its record and in its artifact, each once. What cannot be read is told by whoever reads more of it.
fn warnings(instance: &Instance) -> Vec<String> {
    let mut all = instance.record.warnings.clone();
    if let Ok(facts) = Facts::read(&instance.artifact) {
        for text in facts.warnings() {
            if !all.iter().any(|known| known == text) {
                all.push(text.to_owned());
            }
        }
    }
    all
}
