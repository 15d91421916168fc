//! Which artifacts were made from which.

use crate::input::{Instance, ReportInput};
use crate::read::error::{ReadError, form};
use crate::read::facts::Facts;
use plyflow_model::artifact::{
    Attributes, Boundary, Comparison, Confirmation, Forming, Zone, Zones,
};
use serde::Deserialize;

/// Instances, by their positions, with what each tells of itself and of what it took.
#[derive(Clone, Copy)]
pub(super) struct Links<'a> {
    pub(super) input: &'a ReportInput,
    /// As many as there are instances; absent when an artifact cannot be read.
    pub(super) facts: &'a [Option<Facts>],
}

impl<'a> Links<'a> {
    pub(super) fn instance(self, at: usize) -> &'a Instance {
        &self.input.instances[at]
    }

    pub(super) fn facts(self, at: usize) -> Option<&'a Facts> {
        self.facts[at].as_ref()
    }

    pub(super) fn key(self, at: usize) -> &'a str {
        &self.instance(at).record.key
    }

    /// All of a kind.
    pub(super) fn of_kind(self, kind: &str) -> impl Iterator<Item = usize> {
        let is = move |at: &usize| self.facts(*at).is_some_and(|f| f.kind == kind);
        (0..self.facts.len()).filter(is)
    }

    /// Whether one took what another gave.
    fn took(self, at: usize, giver: usize) -> bool {
        let key = self.key(giver);
        self.facts(at).is_some_and(|f| f.took(key))
    }

    /// Those of a kind that took what `giver` gave.
    pub(super) fn takers(self, kind: &str, giver: usize) -> Vec<usize> {
        let all = self.of_kind(kind);
        all.filter(|at| self.took(*at, giver)).collect()
    }

    /// Keys of what arrived at a port of some instances.
    pub(super) fn at_port(
        self,
        of: impl IntoIterator<Item = usize>,
        port: &'a str,
    ) -> impl Iterator<Item = &'a str> {
        let facts = of.into_iter().filter_map(move |at| self.facts(at));
        facts.flat_map(move |f| f.at_port(port))
    }

    pub(super) fn is_local(self, at: usize) -> bool {
        let facts = self.facts(at);
        facts.is_some_and(|f| f.attributes["zone"].is_object())
    }

    /// The zone of a local run; `None` when its artifact cannot be read.
    pub(super) fn zone(self, at: usize) -> Option<Result<Zone, ReadError>> {
        let zone = &self.facts(at)?.attributes["zone"];
        Some(Zone::deserialize(zone).map_err(form("attribute 'zone'")))
    }

    /// Lists of zones that were drawn from what `giver` gave, each with those drawn again after a first look, and so on; one that
    /// is empty where none was.
    pub(super) fn zone_lists(self, giver: usize) -> Vec<Vec<usize>> {
        let mut takers = self.takers(Zones::KIND, giver);
        let all = takers.clone();
        takers.retain(|at| !self.is_wider(*at, &all));
        let is_first = |at: &&usize| !takers.iter().any(|t| self.took(**at, *t));
        let lists = takers.iter().filter(is_first).flat_map(|&at| {
            let further = self.zone_lists(at).into_iter();
            further.map(move |rest| std::iter::once(at).chain(rest).collect())
        });
        let lists: Vec<Vec<usize>> = lists.collect();
        if lists.is_empty() {
            return vec![Vec::new()];
        }
        lists
    }

    /// Whether a list of zones is one with wider margins, drawn beside another list: what is held against the runs of that one.
    fn is_wider(self, at: usize, among: &[usize]) -> bool {
        let wide = |at: usize| {
            let facts = self.facts(at);
            facts.is_some_and(|f| f.attributes["wider"].is_number())
        };
        wide(at)
            && among.iter().any(|other| !wide(*other))
            && self.takers(Comparison::KIND, at).is_empty()
    }

    /// What followed the defects of some local runs through other runs of their zones; of several the last.
    pub(super) fn confirmation(self, locals: &[usize]) -> Option<usize> {
        let is_of = |at: &usize| {
            let mut keys = self.at_port([*at], "local");
            keys.any(|key| locals.iter().any(|l| self.key(*l) == key))
        };
        self.of_kind(Confirmation::KIND).filter(is_of).last()
    }

    /// Forming runs whose boundary was made for the zones of a list.
    pub(super) fn local_runs(self, zones: usize) -> impl Iterator<Item = usize> {
        let boundaries = self.takers(Boundary::KIND, zones).into_iter();
        boundaries.flat_map(move |b| self.takers(Forming::KIND, b))
    }

    /// What compares the last of the lists of zones with the global run, or, while that has not run, an earlier one; and what else
    /// compares the same list.
    pub(super) fn comparisons(self, zones: &[usize], global: usize) -> Option<(usize, Vec<usize>)> {
        zones.iter().rev().find_map(|z| {
            let mut all = self.takers(Comparison::KIND, *z);
            let drawn = all.iter().position(|at| self.took(*at, global))?;
            Some((all.remove(drawn), all))
        })
    }

    /// Of several runs of one zone (other elements, other sizes, other passes) the one that was compared, of several of these the last, as
    /// `comparison` has it; or else the finest.
    pub(super) fn one_of_each_zone(
        self,
        runs: Vec<usize>,
        comparison: Option<usize>,
    ) -> Vec<usize> {
        let compared: Vec<&str> = self.at_port(comparison, "local").collect();
        let rank = |at: usize| {
            let size = self
                .facts(at)
                .and_then(|f| f.attributes["element_size"].as_f64());
            let place = compared.iter().rposition(|key| *key == self.key(at));
            // The last place first, and what has none behind all.
            let passed_over = place.map_or(usize::MAX, |k| compared.len() - k);
            (passed_over, size.unwrap_or(f64::INFINITY))
        };
        let zone = |at: usize| self.zone(at).and_then(Result::ok);
        let mut kept: Vec<usize> = Vec::new();
        for at in runs {
            match kept.iter_mut().find(|k| zone(**k) == zone(at)) {
                None => kept.push(at),
                Some(k) if rank(at) < rank(*k) => *k = at,
                Some(_) => {}
            }
        }
        kept
    }
}
