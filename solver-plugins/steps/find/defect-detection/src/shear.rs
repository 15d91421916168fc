//! Which shear angles count as too large: those that the step is asked for, or those of the ply's material.

use plyflow_model::artifact::{ShearLimits, Sheet};

/// The limits of a ply; `None`: its shear is not judged.
pub fn limits(sheet: &Sheet, asked: ShearLimits) -> Option<ShearLimits> {
    asked.or(sheet.over_shear.unwrap_or_default()).judged()
}

/// What all limits have in common, sign by sign.
pub fn common(limits: impl Iterator<Item = Option<ShearLimits>>) -> ShearLimits {
    let limits = limits.map(Option::unwrap_or_default);
    let same = |a: Option<f64>, b: Option<f64>| a.filter(|_| a == b);
    limits
        .reduce(|a, b| ShearLimits {
            positive: same(a.positive, b.positive),
            negative: same(a.negative, b.negative),
        })
        .unwrap_or_default()
}

/// Limits for a message.
pub fn told(limits: ShearLimits) -> String {
    let one = |name: &str, limit: Option<f64>| {
        limit.map(|a| format!("{name}: {:.1} deg", a.to_degrees()))
    };
    let [positive, negative] = [
        one("over_shear_positive", limits.positive),
        one("over_shear_negative", limits.negative),
    ];
    let all: Vec<String> = positive.into_iter().chain(negative).collect();
    all.join(", ")
}

/// What is told of plies whose shear is judged for one sign or not at all: one text for the plies of a material.
pub fn not_judged<'a>(
    plies: impl Iterator<Item = (&'a str, Option<&'a str>, Option<ShearLimits>)>,
) -> Vec<String> {
    let mut groups: Vec<(Option<&str>, ShearLimits, Vec<String>)> = Vec::new();
    for (name, material, limits) in plies {
        let limits = limits.unwrap_or_default();
        if limits.positive.is_some() && limits.negative.is_some() {
            continue;
        }
        let name = format!("'{name}'");
        match groups
            .iter_mut()
            .find(|(m, l, _)| *m == material && *l == limits)
        {
            Some((.., names)) => names.push(name),
            None => groups.push((material, limits, vec![name])),
        }
    }
    let text = |(material, limits, names): &(Option<&str>, ShearLimits, Vec<String>)| {
        let what = match (limits.positive, limits.negative) {
            (None, None) => "shear",
            (None, _) => "positive shear",
            _ => "negative shear",
        };
        let of = material.map_or_else(
            || "their material".to_owned(),
            |m| format!("the material '{m}'"),
        );
        format!(
            "{what} of {} is not judged: {of} does not say from which shear angles it wrinkles. Write them in the material file, such as \
             `over_shear: {{positive: 8 deg, negative: -50 deg}}` (a bias-extension test tells), or give over_shear_positive and \
             over_shear_negative to this step",
            names.join(", ")
        )
    };
    groups.iter().map(text).collect()
}
