//! What the watch tells.

use crate::forming::Forming;
use crate::watch::deep::{Deep, Peak, Watched};
use crate::watch::look::Watch;
use crate::watch::pairs::{Kind, Pair};
use crate::words::in_mm;
use plyflow_model::artifact::{Depth, DepthPeak};
use std::collections::BTreeMap;

/// What the watch found of one pair.
#[derive(Debug, Clone, PartialEq)]
pub struct PairDepth {
    /// The pair.
    pub pair: Pair,
    /// At the end.
    pub end: Deep,
    /// The deepest of all rows.
    pub peak: Peak,
}

impl PairDepth {
    /// Of the thinner sheet, at the end.
    pub fn share(&self) -> f64 {
        self.end.depth / self.pair.thinner
    }

    /// The same of the deepest on the way.
    pub fn peak_share(&self) -> f64 {
        self.peak.deep.depth / self.pair.thinner
    }
}

impl Watch {
    /// What has been found so far, by pair.
    pub fn depths(&self, watched: &Watched) -> Vec<PairDepth> {
        (self.pairs().iter().zip(&watched.now).zip(&watched.peaks))
            .map(|((pair, end), peak)| PairDepth {
                pair: pair.clone(),
                end: *end,
                peak: *peak,
            })
            .collect()
    }

    /// What to say when a pair is in each other by more than it may: the run is to stop.
    pub fn gone_through(&self, watched: &Watched, forming: &Forming) -> Option<String> {
        let pairs = self.pairs().iter().zip(&watched.now);
        let over = pairs.filter(|(p, now)| now.depth > p.most);
        let (pair, now) = over.max_by(|a, b| {
            let share = |(p, d): &(&Pair, &Deep)| d.depth / p.most;
            share(a).total_cmp(&share(b))
        })?;
        let (one, other) = pair.name.split_once('/').unwrap_or((&pair.name, ""));
        let (t, end) = (forming.model.time(), forming.load.duration());
        let mut text = format!(
            "'{other}' has gone through '{one}' at {}: they are {:.3} mm deep in each other, {:.1} times the thickness of the thinner one ({:.3} mm)",
            in_mm(now.place),
            1e3 * now.depth,
            now.depth / pair.thinner,
            1e3 * pair.thinner
        );
        if let Some(start) = forming.reference.get(now.node as usize) {
            let sheet = (forming.model.sheets().iter()).find(|s| s.nodes.contains(&now.node));
            text += &format!(
                "; the node is one of '{}', before forming at {}",
                sheet.map_or("?", |s| s.name.as_str()),
                in_mm(*start)
            );
        }
        text += &format!(
            "; seen at t = {t:.5} s of {end:.5} s ({}). What to try: smaller elements there, longer process times, a smaller `time_step` or a larger \
             `least_areal_mass`, with which contacts are stiffer",
            forming.load.phase(t)
        );
        Some(text)
    }
}

/// What to tell of pairs that end in each other.
pub fn depth_warnings(depths: &[PairDepth]) -> Vec<String> {
    let deep = depths.iter().filter(|d| d.end.depth > d.pair.bound);
    deep.map(|d| {
        let (one, other) = d.pair.name.split_once('/').unwrap_or((&d.pair.name, ""));
        let (mm, at) = (1e3 * d.end.depth, in_mm(d.end.place));
        match d.pair.kind {
            Kind::Edges => format!(
                "an edge of {} goes {mm:.2} mm through '{other}' between its nodes, at {at}: the elements of '{other}' are too long to bend around it. Take smaller ones (`element_size`, of films `diaphragm_element_size`), or round the edge",
                edges_of(one)
            ),
            _ => format!(
                "'{one}' and '{other}' end {mm:.3} mm deep in each other at {at}: {:.0} % of the thinner one, bound {:.0} %. The result is wrong there by as much. Take smaller elements there, or a smaller `time_step`, with which contacts are stiffer",
                100.0 * d.share(),
                100.0 * d.pair.bound / d.pair.thinner,
            ),
        }
    })
    .collect()
}

/// Whose edges a pair is of.
fn edges_of(one: &str) -> String {
    match one.strip_suffix("_edges") {
        Some(part) if part != "tool" => format!("'{part}'"),
        _ => "the tool".to_owned(),
    }
}

/// By pair, for the artifact.
pub fn depth_attributes(depths: &[PairDepth]) -> BTreeMap<String, Depth> {
    let place = |d: &Deep| (d.depth > 0.0).then_some(d.place);
    // Most pairs of a stack never meet.
    let met = depths.iter().filter(|d| d.peak.deep.depth > 0.0);
    met.map(|d| {
        let of = Depth {
            end: d.end.depth,
            place: place(&d.end),
            share: d.share(),
            bound: d.pair.bound.is_finite().then_some(d.pair.bound),
            peak: DepthPeak {
                depth: d.peak.deep.depth,
                time: d.peak.time,
                place: place(&d.peak.deep),
                share: d.peak_share(),
            },
        };
        (d.pair.name.clone(), of)
    })
    .collect()
}
