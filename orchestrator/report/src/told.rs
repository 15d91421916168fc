//! Verdicts on limits, in words.

use crate::judged::{Finding, Judged, Kept, size};
use crate::units::{plural, quantity};
use plyflow_model::workflow::LimitOn;

/// Digits of sizes.
const DIGITS: i32 = 3;

impl Judged {
    /// What is limited, and where: `wrinkle height (region web)`.
    #[must_use]
    pub fn title(&self) -> String {
        let of = [
            Some(self.of.as_str()).filter(|of| !of.is_empty()),
            self.place.as_deref(),
        ];
        let of: Vec<&str> = of.into_iter().flatten().collect();
        match of.is_empty() {
            true => self.on.words().to_owned(),
            false => format!("{} ({})", self.on.words(), of.join(", ")),
        }
    }

    /// How often the worst is as large as the limit; infinite beside a limit of nought.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        let worst = size(self.on, self.worst.as_ref()?.value);
        let limit = size(self.on, self.limit);
        Some(if limit > 0.0 {
            worst / limit
        } else {
            f64::INFINITY
        })
    }
}

/// The limit in words: `at most 1 mm`.
#[must_use]
pub fn allowed_text(j: &Judged) -> String {
    let limit = quantity(j.limit, j.on.unit(), DIGITS);
    match j.on {
        LimitOn::ShearNegative => format!("at least {limit}"),
        LimitOn::Shear | LimitOn::FibreStrain | LimitOn::FibreDeviation => {
            format!("at most ±{limit}")
        }
        _ => format!("at most {limit}"),
    }
}

/// The worst that was found, in words: `2.1 mm`.
#[must_use]
pub fn found_text(j: &Judged) -> String {
    match (&j.worst, j.verdict) {
        (Some(f), _) => quantity(f.value, j.on.unit(), DIGITS),
        (None, Kept::NotJudged) => String::new(),
        (None, _) => "none".into(),
    }
}

/// A finding beyond its limit, in words: `wrinkle height 2.1 mm (at most 1 mm), AW1 on ply_1, zone A at ..`.
fn beyond_text(j: &Judged, f: &Finding) -> String {
    format!(
        "{} {} ({}), {}",
        j.title(),
        quantity(f.value, j.on.unit(), DIGITS),
        allowed_text(j),
        f.place()
    )
}

/// Whether the part is good, in a sentence without its subject; `None` without limits.
#[must_use]
pub fn in_short(all: &[Judged]) -> Option<(Kept, String)> {
    let of = |v| all.iter().filter(move |j| j.verdict == v);
    let count = |v| of(v).count();
    let (beyond, open) = (count(Kept::Beyond), count(Kept::NotJudged));
    let limits = plural(all.len(), "limit", "limits");
    if all.is_empty() {
        return None;
    }
    let rest = match open {
        0 => String::new(),
        n => format!(" ({n} not judged)"),
    };
    let own = match all.len() {
        1 => "its limit",
        _ => "all its limits",
    };
    Some(match (beyond, open) {
        (0, 0) => (
            Kept::Within,
            format!("keeps {own} where the models have looked"),
        ),
        (0, n) if n == all.len() => (
            Kept::NotJudged,
            format!("is not judged: none of {limits} could be"),
        ),
        (0, n) => (
            Kept::NotJudged,
            format!("is not judged by {n} of {limits}; it keeps the others"),
        ),
        (n, _) => {
            let ratio = |j: &&Judged| j.ratio().unwrap_or(0.0);
            let worst = of(Kept::Beyond).max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
            let worst = worst.and_then(|j| Some(beyond_text(j, j.beyond.first()?)));
            let text = worst.unwrap_or_default();
            (
                Kept::Beyond,
                format!("exceeds {n} of {limits}{rest}; worst: {text}"),
            )
        }
    })
}

/// Head and rows of a table for a terminal: limit, allowed, found, verdict, where, judged by.
#[must_use]
pub fn table(all: &[Judged]) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let row = |j: &Judged| {
        let place = j.worst.as_ref().map(Finding::place);
        vec![
            j.title(),
            allowed_text(j),
            found_text(j),
            j.verdict.word().to_owned(),
            place.unwrap_or_default(),
            j.worst.as_ref().map_or(&j.by, |f| &f.by).clone(),
        ]
    };
    let head = vec!["limit", "allowed", "worst found", "verdict", "where", "by"];
    (head, all.iter().map(row).collect())
}

/// Why limits are not judged, and what is to be known of verdicts, each once with what it is about.
#[must_use]
pub fn reasons(all: &[Judged]) -> Vec<String> {
    let mut told: Vec<(Kept, &str, Vec<String>)> = Vec::new();
    for j in all {
        for note in &j.notes {
            let kind = match j.verdict {
                Kept::NotJudged => Kept::NotJudged,
                _ => Kept::Within,
            };
            match told
                .iter_mut()
                .find(|(k, text, _)| *k == kind && text == note)
            {
                Some((.., of)) => of.push(j.title()),
                None => told.push((kind, note, vec![j.title()])),
            }
        }
    }
    let line = |(kind, text, of): &(Kept, &str, Vec<String>)| match kind {
        Kept::NotJudged => format!("not judged: {}: {text}", of.join(", ")),
        _ => format!("note: {text}"),
    };
    told.iter().map(line).collect()
}

/// What a check of the limits fails by: those beyond, and those that are not judged; `None`: by nothing.
#[must_use]
pub fn failing(all: &[Judged]) -> Option<String> {
    let mut parts = Vec::new();
    for (verdict, one, many) in [
        (Kept::Beyond, "limit exceeded", "limits exceeded"),
        (Kept::NotJudged, "limit not judged", "limits not judged"),
    ] {
        let titles: Vec<String> = (all.iter())
            .filter(|j| j.verdict == verdict)
            .map(Judged::title)
            .collect();
        if !titles.is_empty() {
            let n = plural(titles.len(), one, many);
            parts.push(format!("{n}: {}", titles.join(", ")));
        }
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(on: LimitOn, limit: f64, values: &[f64], verdict: Kept) -> Judged {
        let finding = |v: &f64| Finding {
            name: Some("AW1".into()),
            ply: "ply_1".into(),
            zone: Some("A".into()),
            at: [0.12, -0.03],
            value: *v,
            by: "local.A".into(),
            at_cut: false,
            cause: None,
            crest_shear: None,
        };
        let found: Vec<Finding> = values.iter().map(finding).collect();
        Judged {
            of: String::new(),
            place: None,
            on,
            limit,
            verdict,
            worst: found.first().cloned(),
            beyond: if verdict == Kept::Beyond {
                found
            } else {
                vec![]
            },
            by: "1 fine run in its zone".into(),
            notes: match verdict {
                Kept::NotJudged => vec!["nobody has looked".into()],
                _ => vec![],
            },
        }
    }

    #[test]
    fn the_headline_names_the_worst_by_how_often_it_is_its_limit() {
        let all = [
            judged(LimitOn::WrinkleLength, 0.02, &[0.03], Kept::Beyond),
            judged(LimitOn::WrinkleHeight, 1e-3, &[2.1e-3], Kept::Beyond),
            judged(LimitOn::Shear, 1.0, &[0.2], Kept::Within),
            judged(LimitOn::BridgingGap, 1e-3, &[], Kept::NotJudged),
        ];
        let (kept, text) = in_short(&all).unwrap();
        assert_eq!(kept, Kept::Beyond);
        assert_eq!(
            text,
            "exceeds 2 of 4 limits (1 not judged); worst: wrinkle height 2.1 mm (at most 1 mm), AW1 on ply_1, zone A at x = 120 mm, y = -30 mm"
        );
        assert_eq!(
            failing(&all).unwrap(),
            "2 limits exceeded: wrinkle length, wrinkle height; 1 limit not judged: bridging gap"
        );
        assert_eq!(
            reasons(&all),
            ["not judged: bridging gap: nobody has looked"]
        );
    }

    #[test]
    fn without_limits_nothing_is_said_and_kept_ones_fail_nothing() {
        assert_eq!(in_short(&[]), None);
        let kept = [judged(LimitOn::ShearNegative, -0.9, &[-0.5], Kept::Within)];
        assert_eq!(in_short(&kept).unwrap().0, Kept::Within);
        assert_eq!(failing(&kept), None);
        assert_eq!(allowed_text(&kept[0]), "at least -51.6 deg");
        let both = judged(LimitOn::Shear, 0.9, &[], Kept::Within);
        assert_eq!(allowed_text(&both), "at most ±51.6 deg");
        let open = [judged(LimitOn::Shear, 1.0, &[], Kept::NotJudged)];
        assert_eq!(in_short(&open).unwrap().0, Kept::NotJudged);
    }
}
