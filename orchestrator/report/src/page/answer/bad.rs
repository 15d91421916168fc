//! Where the part is not good.

use crate::judge::largest;
use crate::judged::{Finding, Kept, size};
use crate::page::content::Content;
use crate::told::allowed_text;
use crate::units::quantity;
use plyflow_model::workflow::LimitOn;

/// A place where the part is not good, or has its largest defects.
pub(super) struct Bad {
    /// What was found there.
    pub(super) found: Vec<(LimitOn, Finding)>,
    /// By how much, in words.
    pub(super) text: Vec<String>,
    /// The largest share of a limit.
    pub(super) ratio: f64,
}

impl Bad {
    pub(super) fn title(&self) -> String {
        self.found[0].1.place()
    }
}

/// Places beyond limits, the worst first; without limits the largest defects.
pub(super) fn places(content: &Content<'_>) -> Vec<Bad> {
    let input = content.input;
    if input.judged.is_empty() {
        let all = largest(input, &content.material).into_iter();
        return all
            .map(|(on, f)| Bad {
                text: vec![format!(
                    "{} {}",
                    on.words(),
                    quantity(f.value, on.unit(), 3)
                )],
                found: vec![(on, f)],
                ratio: 0.0,
            })
            .collect();
    }
    let mut all: Vec<Bad> = Vec::new();
    for j in input.judged.iter().filter(|j| j.verdict == Kept::Beyond) {
        for f in &j.beyond {
            let own = size(j.on, f.value);
            let limit = size(j.on, j.limit);
            let ratio = if limit > 0.0 {
                own / limit
            } else {
                f64::INFINITY
            };
            let of = format!(
                "{} {} ({})",
                j.on.words(),
                quantity(f.value, j.on.unit(), 3),
                allowed_text(j)
            );
            let same = |b: &&mut Bad| b.found[0].1.name.is_some() && b.title() == f.place();
            match all.iter_mut().find(same) {
                Some(b) => {
                    b.found.push((j.on, f.clone()));
                    b.text.push(of);
                    b.ratio = b.ratio.max(ratio);
                }
                None => all.push(Bad {
                    found: vec![(j.on, f.clone())],
                    text: vec![of],
                    ratio,
                }),
            }
        }
    }
    all.sort_by(|a, b| b.ratio.total_cmp(&a.ratio));
    all
}
