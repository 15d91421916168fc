//! Where which limit holds.

use super::evidence::Evidence;
use crate::judged::{Finding, Judged, Kept, size};
use plyflow_model::artifact::Sheet;
use plyflow_model::outline::Point;
use plyflow_model::regions::holds;
use plyflow_model::workflow::{LimitOn, LimitPlace, Limits};

/// Limits with the outlines of their places.
pub(super) struct Governed<'a> {
    limits: &'a Limits,
    /// Of each place of the limits its own corners, if it has a polygon or a rectangle (m).
    corners: Vec<Option<Vec<Point>>>,
    sheets: &'a [Sheet],
    /// Places that have been looked at, by ply (m); `None`: nothing is known of what there is to look at.
    looked_at: Option<Vec<(&'a str, &'a [Point])>>,
}

impl<'a> Governed<'a> {
    /// `sheets`: of the whole part, with their regions.
    pub(super) fn new(limits: &'a Limits, sheets: &'a [Sheet]) -> Self {
        let own = |p: &LimitPlace| p.corners().and_then(Result::ok);
        Self {
            limits,
            corners: limits.places.iter().map(own).collect(),
            sheets,
            looked_at: None,
        }
    }

    /// With the middles of all cells that something was looked for in, by ply (m): where there is none, nothing can be found.
    pub(super) fn over(mut self, cells: Vec<(&'a str, &'a [Point])>) -> Self {
        self.looked_at = Some(cells);
        self
    }

    /// Whether the limit of a place counts for any cell.
    fn is_met(&self, on: LimitOn, k: usize) -> bool {
        let Some(cells) = &self.looked_at else {
            return true;
        };
        let counts = |ply: &str, at: &Point| self.place_at(on, ply, *at) == Some(Some(k));
        let mut cells = cells.iter();
        cells.any(|(ply, all)| all.iter().any(|at| counts(ply, at)))
    }

    /// Whether a place of the limits holds one of a ply (m).
    fn holds(&self, k: usize, ply: &str, at: Point) -> bool {
        let place = &self.limits.places[k];
        if place.ply.as_ref().is_some_and(|p| p != ply) {
            return false;
        }
        if let Some(region) = &place.region {
            let sheet = self.sheets.iter().find(|s| s.name == ply);
            let regions = sheet.map_or(&[][..], |s| &s.regions);
            let mut named = regions.iter().filter(|r| r.name == *region);
            return named.any(|r| holds(&r.outline, at));
        }
        match &self.corners[k] {
            Some(corners) => holds(corners, at),
            None => place.polygon.is_none() && place.rectangle.is_none(),
        }
    }

    /// The place whose limit counts at a place of a ply (m): the last that states one and holds it; the outer `None`: none counts.
    pub(super) fn place_at(&self, on: LimitOn, ply: &str, at: Point) -> Option<Option<usize>> {
        let states = |k: &usize| self.limits.places[*k].values.of(on).is_some();
        let mut last_first = (0..self.corners.len()).rev().filter(states);
        match last_first.find(|k| self.holds(*k, ply, at)) {
            Some(k) => Some(Some(k)),
            None => self.limits.part.of(on).map(|_| None),
        }
    }

    /// Every limit with its verdict, the part's before those of places. `evidence` tells what was looked at.
    pub(super) fn judged(&self, of: &str, evidence: impl Fn(LimitOn) -> Evidence) -> Vec<Judged> {
        let mut all = Vec::new();
        for on in LimitOn::ALL.into_iter().filter(|on| self.limits.limit(*on)) {
            let evidence = evidence(on);
            let part = self.limits.part.of(on).map(|limit| (None, limit));
            let places = self.limits.places.iter().enumerate();
            let places = places.filter_map(|(k, p)| Some((Some(k), p.values.of(on)?)));
            for (place, limit) in part.into_iter().chain(places) {
                all.push(self.one(of, (place, on, limit), &evidence));
            }
        }
        all.sort_by_key(|j: &Judged| j.place.is_some());
        all
    }

    fn one(
        &self,
        of: &str,
        (place, on, limit): (Option<usize>, LimitOn, f64),
        evidence: &Evidence,
    ) -> Judged {
        let mine = |f: &&Finding| self.place_at(on, &f.ply, f.at) == Some(place);
        let mut found: Vec<Finding> = evidence.findings.iter().filter(mine).cloned().collect();
        found.sort_by(|a, b| size(on, b.value).total_cmp(&size(on, a.value)));
        let worst = found.first().cloned();
        let mut open = evidence.open.clone();
        open.extend(at_cuts(&found));
        if let Some(k) = place.filter(|k| !self.is_met(on, *k)) {
            open.push(format!(
                "no cell has its middle in {}: it lies beside the ply, is smaller than the elements, or places after it hold the same",
                self.limits.places[k].title()
            ));
        }
        // The texts of YAML are rounded once when they are read: a value that is the limit is not beyond it.
        let most = size(on, limit) * (1.0 + 1e-12);
        found.retain(|f| size(on, f.value) > most);
        let verdict = match (found.is_empty(), open.is_empty()) {
            (false, _) => Kept::Beyond,
            (true, false) => Kept::NotJudged,
            (true, true) => Kept::Within,
        };
        Judged {
            of: of.to_owned(),
            place: place.map(|k| self.limits.places[k].title()),
            on,
            limit,
            verdict,
            worst,
            beyond: found,
            by: evidence.by.join("; "),
            notes: match verdict {
                Kept::NotJudged => open,
                _ => evidence.notes.clone(),
            },
        }
    }
}

/// What is said of defects that go on beyond what was looked at.
fn at_cuts(found: &[Finding]) -> Option<String> {
    let mut names: Vec<&str> = Vec::new();
    for f in found.iter().filter(|f| f.at_cut) {
        names.extend(f.name.as_deref().filter(|n| !names.contains(n)));
    }
    let (verb, zones) = match names.len() {
        0 => return None,
        1 => ("reaches", "its zone"),
        _ => ("reach", "their zones"),
    };
    Some(format!(
        "{} {verb} the cut of {zones} and may go on: raise `scale` of `zone-extraction`",
        names.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_model::scene::SheetKind;
    use serde_json::json;

    fn finding(ply: &str, at: [f64; 2], value: f64) -> Finding {
        Finding {
            name: None,
            ply: ply.into(),
            zone: None,
            at,
            value,
            by: "run".into(),
            at_cut: false,
            cause: None,
            crest_shear: None,
        }
    }

    fn verdicts(limits: serde_json::Value, findings: &[Finding]) -> Vec<(Option<String>, Kept)> {
        let limits: Limits = serde_json::from_value(limits).unwrap();
        let mut sheet = Sheet::new("a", SheetKind::Ply, 1e-3, 0.0);
        let web = json!({"name": "web", "outline": [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]], "area": 0.01, "friction": [], "stitches": null});
        sheet.regions = vec![serde_json::from_value(web).unwrap()];
        let sheets = [sheet];
        let evidence = |_| Evidence {
            findings: findings.to_vec(),
            ..Evidence::default()
        };
        let all = Governed::new(&limits, &sheets).judged("", evidence);
        all.into_iter().map(|j| (j.place, j.verdict)).collect()
    }

    #[test]
    fn the_last_place_that_holds_a_finding_counts_in_the_place_of_the_part() {
        let limits = json!({"shear": "40 deg", "places": [
            {"ply": "a", "shear": "60 deg"}, {"ply": "a", "region": "web", "shear": "20 deg"}]});
        let deg = |d: f64| d.to_radians();
        let inside = finding("a", [0.05, 0.05], deg(30.0));
        let (part, ply, web) = (
            None,
            Some("a".to_owned()),
            Some("region web of a".to_owned()),
        );
        use Kept::{Beyond as B, Within as W};
        assert_eq!(
            verdicts(limits.clone(), &[inside]),
            [(part.clone(), W), (ply.clone(), W), (web.clone(), B)]
        );
        // Outside of the region the looser limit of the ply counts, on another ply that of the part.
        let others = [
            finding("a", [0.5, 0.0], deg(-50.0)),
            finding("b", [0.05, 0.05], deg(-50.0)),
        ];
        assert_eq!(verdicts(limits, &others), [(part, B), (ply, W), (web, W)]);
    }

    #[test]
    fn exactly_the_limit_is_within_and_a_hair_more_is_beyond() {
        let limit = || json!({"wrinkle_height": "1 mm"});
        let with = |v: f64| verdicts(limit(), &[finding("a", [0.0; 2], v)])[0].1;
        assert_eq!(
            (with(1e-3), with(1.000_001e-3)),
            (Kept::Within, Kept::Beyond)
        );
    }

    #[test]
    fn what_was_not_looked_at_is_no_verdict_but_what_is_beyond_is() {
        let limits: Limits = serde_json::from_value(json!({"shear": "40 deg"})).unwrap();
        let with = |findings: Vec<Finding>| {
            let evidence = move |_| Evidence {
                findings: findings.clone(),
                open: vec!["half of it was not looked at".into()],
                ..Evidence::default()
            };
            Governed::new(&limits, &[]).judged("", evidence).remove(0)
        };
        let open = with(vec![finding("a", [0.0; 2], 0.1)]);
        assert_eq!(open.verdict, Kept::NotJudged);
        assert_eq!(open.notes, ["half of it was not looked at"]);
        assert_eq!(
            with(vec![finding("a", [0.0; 2], 1.0)]).verdict,
            Kept::Beyond
        );
    }
    #[test]
    fn a_defect_that_reaches_the_cut_leaves_open_the_limit_of_its_own_place_alone() {
        let mut at_cut = finding("a", [0.05, 0.05], 1e-4);
        (at_cut.name, at_cut.at_cut) = (Some("AW1".into()), true);
        let limits = json!({"wrinkle_height": "1 mm", "places": [{"region": "web", "wrinkle_height": "1 mm"}]});
        let web = Some("region web".to_owned());
        assert_eq!(
            verdicts(limits, &[at_cut]),
            [(None, Kept::Within), (web, Kept::NotJudged)]
        );
    }
}
