//! Material files: new numbers put into a complete file, or a fragment of one.

use plyflow_files::open::{self, MOST_WRITTEN};
use plyflow_files::text::decode;
use plyflow_model::artifact::Characterisation;
use plyflow_model::material::Material;
use plyflow_sdk::{Host, StepError};
use serde_json::{Map, Value, json};

/// The plugin whose parameters a characterisation tells.
const FABRIC: &str = "material-fabric";

/// A complete material file that new numbers are put into.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    value: Map<String, Value>,
    /// Where it came from, for the head of the new file.
    origin: String,
    /// Mass per area (kg/m2).
    pub areal_mass: f64,
}

impl Template {
    /// Reads a material file's text.
    ///
    /// # Errors
    /// When it is no YAML, no material, or none of a fabric: the blocks of a characterisation are parameters of
    /// `material-fabric`, and no other material would take them.
    pub fn parse(text: &str, origin: &str) -> Result<Self, String> {
        let mut options = serde_saphyr::Options::default();
        options.strict_booleans = true;
        let value: Value = serde_saphyr::from_str_with_options(text, options)
            .map_err(|e| format!("{origin}: is no YAML: {e}"))?;
        let material: Material = serde_json::from_value(value.clone())
            .map_err(|e| format!("{origin}: is no material file: {e}"))?;
        let Value::Object(value) = value else {
            return Err(format!("{origin}: is no material file"));
        };
        if !is_fabric(&material.plugin) {
            return Err(format!(
                "{origin}: its plugin is `{}`, which has no shear and bending laws of a fabric to put new numbers into; \
                 expected a material file with `plugin: material-fabric`",
                material.plugin
            ));
        }
        Ok(Self {
            value,
            origin: origin.into(),
            areal_mass: material.areal_mass.si(),
        })
    }

    /// The template of a step: from the file that its parameter `template` names, or from the files of the
    /// characterisation wired to its port `material`; `None` when there is neither.
    ///
    /// # Errors
    /// When both are given, or what is given holds no material.
    pub fn of(host: &Host, file: Option<&str>) -> Result<Option<Self>, StepError> {
        let inputs = host.inputs_of("material")?;
        match (file, inputs.first()) {
            (None, None) => Ok(None),
            (Some(_), Some(_)) => Err(
                "both the parameter `template` and the input `material` are given; \
                 the numbers can go into one material file only"
                    .into(),
            ),
            (Some(path), None) => {
                let bytes = open::read(std::path::Path::new(path), MOST_WRITTEN)
                    .map_err(|e| format!("{path}: cannot be read: {e}"))?;
                let text = decode(&bytes).map_err(|e| format!("{path}: {e}"))?;
                let name = std::path::Path::new(path)
                    .file_name()
                    .and_then(|n| n.to_str());
                Ok(Some(Self::parse(&text, name.unwrap_or(path))?))
            }
            (None, Some(input)) => {
                let told: Characterisation = host.attributes(input)?;
                let origin = format!("step '{}'", input.step);
                let mut texts = told.files.iter().filter_map(|f| f.text.as_ref());
                let found = texts.find_map(|text| Self::parse(text, &origin).ok());
                found.map(Some).ok_or_else(|| {
                    format!(
                        "step '{}' made no complete material file; give it a `template`",
                        input.step
                    )
                    .into()
                })
            }
        }
    }
}

impl Template {
    /// A parameter of the material, by the names on the way to it; `None` where it is not told or empty.
    #[must_use]
    pub fn parameter(&self, path: &[&str]) -> Option<&Value> {
        let with = self.value.get("with");
        let found = path.iter().fold(with, |v, key| v.and_then(|v| v.get(key)));
        found.filter(|v| !v.is_null())
    }

    /// Refuses a bending law that the material would refuse beside what the template has.
    fn takes_bending(&self, blocks: &[Block<'_>]) -> Result<(), String> {
        let new = |sign: &str| {
            blocks
                .iter()
                .any(|b| b.0 == ["bending", sign] && b.1.is_some())
        };
        if !new("positive") && !new("negative") {
            return Ok(());
        }
        let bending = self.value.get("with").and_then(|w| w.get("bending"));
        let has = |key: &str| bending.is_some_and(|b| b.get(key).is_some_and(|v| !v.is_null()));
        let origin = &self.origin;
        if has("family_1") || has("family_2") {
            return Err(format!(
                "{origin}: has bending laws of each family (`bending.family_1`, `bending.family_2`), and the law of this test \
                 is one of both families: material-fabric takes either. Take these blocks out of the template, or leave \
                 `template` out and put the fragment into a family's block by hand"
            ));
        }
        if !new("positive") && !has("positive") {
            return Err(format!(
                "{origin}: has no `bending.positive`, and material-fabric takes `bending.negative` only beside it: evaluate the \
                 test of positive bending first and take its file, or set `bending: positive` where both bends are alike"
            ));
        }
        Ok(())
    }
}

/// Whether a material plugin, by name or path, is `material-fabric`.
fn is_fabric(plugin: &str) -> bool {
    let file = plugin.rsplit('/').next().unwrap_or(plugin);
    plugin == FABRIC || (file != plugin && file.replace('_', "-").contains(FABRIC))
}

/// The areal mass of a test: the parameter, else that of the template.
///
/// # Errors
/// When there is neither.
pub fn areal_mass(given: Option<f64>, template: Option<&Template>) -> Result<f64, String> {
    given.or(template.map(|t| t.areal_mass)).ok_or_else(|| {
        "neither `areal_mass` nor a `template` is given; the weight of the strip must be known"
            .to_owned()
    })
}

/// Areal masses (kg/m2) of plies: from a veil to a stack of heavy fabrics.
pub const PLAUSIBLE_AREAL_MASS: [f64; 2] = [0.01, 10.0];

/// What one should know of an areal mass (kg/m2) that no ply has.
pub fn implausible_areal_mass(mass: f64) -> Option<String> {
    let [low, high] = PLAUSIBLE_AREAL_MASS;
    (!(low..=high).contains(&mass)).then(|| {
        format!(
            "the areal mass is {} kg/m2; plies have {low} to {high} kg/m2, a fabric of 300 g/m2 has 0.3: every stiffness of this test is in proportion to it",
            significant(mass)
        )
    })
}

/// A block of the parameters under `with:`: where it goes, and what; `None` takes it away.
pub type Block<'a> = (&'a [&'a str], Option<Value>);

/// Name and text of the file that a characterisation gives: `material.yaml`, the template with the blocks
/// put in, or `fragment` with the blocks alone. `note`: comment lines that say where the numbers come from.
///
/// # Errors
/// When the result is no valid material file.
pub fn file(
    template: Option<&Template>,
    blocks: &[Block<'_>],
    fragment: &str,
    note: &[String],
) -> Result<(String, String), String> {
    let mut text = String::new();
    for line in note {
        text.push_str(&format!("# {line}\n"));
    }
    let Some(template) = template else {
        let mut with = Map::new();
        blocks.iter().for_each(|b| put(&mut with, b));
        text.push_str("# A fragment: its blocks go under `with:` of a material file.\n");
        emit_map(&mut text, &with, 0);
        return Ok((fragment.into(), text));
    };
    template.takes_bending(blocks)?;
    let mut value = template.value.clone();
    let with = value.entry("with").or_insert(Value::Null);
    if with.is_null() {
        *with = json!({});
    }
    if let Value::Object(with) = with {
        blocks.iter().for_each(|b| put(with, b));
    }
    let names: Vec<String> = blocks
        .iter()
        .filter(|b| b.1.is_some())
        .map(|b| b.0.join("."))
        .collect();
    let names = names.join(", ");
    if let Some(first) = note.first() {
        let old = value
            .get("source")
            .and_then(Value::as_str)
            .map(|s| format!("{s}; "));
        let source = format!("{}{names}: {first}", old.unwrap_or_default());
        value.insert("source".into(), Value::from(source.trim_end_matches('.')));
    }
    text.push_str(&format!(
        "# New here: {}. All other numbers are those of {}; comments are not carried over.\n",
        names, template.origin
    ));
    emit_map(&mut text, &value, 0);
    Template::parse(&text, "the new material file")?;
    Ok(("material.yaml".into(), text))
}

fn put(into: &mut Map<String, Value>, (path, value): &Block<'_>) {
    match path {
        [] => {}
        [last] => match value {
            Some(value) => {
                into.insert((*last).into(), value.clone());
            }
            None => {
                into.remove(*last);
            }
        },
        [first, rest @ ..] => {
            let below = into.entry(*first).or_insert(Value::Null);
            // A block that is there and empty is none.
            if below.is_null() {
                *below = json!({});
            }
            if let Value::Object(below) = below {
                put(below, &(rest, value.clone()));
            }
        }
    }
}

/// A quantity as text with six significant digits: `value` in SI, `per` the SI value of one `unit`.
pub fn quantity(value: f64, per: f64, unit: &str) -> String {
    format!("{} {unit}", significant(value / per))
}

/// A number with six significant digits.
pub fn significant(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    let text = format!("{rounded}");
    if text.len() > 14 {
        format!("{rounded:e}")
    } else {
        text
    }
}

/// The order in which people expect a material file's keys; all others follow in the alphabet's.
const ORDER: [&str; 8] = [
    "plyflow_material",
    "name",
    "source",
    "plugin",
    "thickness",
    "areal_mass",
    "over_shear",
    "with",
];
const WIDTH: usize = 100;

fn emit_map(text: &mut String, map: &Map<String, Value>, depth: usize) {
    let mut keys: Vec<&String> = map.keys().collect();
    keys.sort_by_key(|k| {
        (
            ORDER.iter().position(|o| o == k).unwrap_or(ORDER.len()),
            k.as_str(),
        )
    });
    for key in keys {
        text.push_str(&format!("{}{}:", "  ".repeat(depth), scalar(key)));
        emit(text, &map[key.as_str()], depth);
    }
}

/// What follows `key:` or `-`, with its line end.
fn emit(text: &mut String, value: &Value, depth: usize) {
    let flow = flow(value);
    match value {
        Value::Object(map)
            if !map.is_empty()
                && (flow.len() > WIDTH || map.values().any(|v| v.is_object() || v.is_array())) =>
        {
            text.push('\n');
            emit_map(text, map, depth + 1);
        }
        Value::Array(items) if !items.is_empty() && flow.len() > WIDTH => {
            text.push('\n');
            for item in items {
                text.push_str(&format!(
                    "{}- {}\n",
                    "  ".repeat(depth + 1),
                    self::flow(item)
                ));
            }
        }
        _ => text.push_str(&format!(" {flow}\n")),
    }
}

fn flow(value: &Value) -> String {
    match value {
        Value::String(s) => scalar(s),
        Value::Array(items) => format!(
            "[{}]",
            items.iter().map(flow).collect::<Vec<_>>().join(", ")
        ),
        Value::Object(map) => {
            let mut pairs: Vec<(&String, &Value)> = map.iter().collect();
            pairs.sort_by_key(|p| p.0);
            let pairs: Vec<String> = pairs
                .iter()
                .map(|(k, v)| format!("{}: {}", scalar(k), flow(v)))
                .collect();
            format!("{{{}}}", pairs.join(", "))
        }
        other => other.to_string(),
    }
}

/// A text, quoted unless it can only be read as itself.
fn scalar(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || " ._/+-%".contains(c);
    let first = text
        .chars()
        .next()
        .is_some_and(|c| c.is_ascii_alphanumeric() || "./+-".contains(c));
    let word = ["true", "false", "yes", "no", "on", "off", "null", "y", "n"];
    let safe = first
        && text.chars().all(plain)
        && text.trim() == text
        && text.parse::<f64>().is_err()
        && !text.starts_with("- ")
        && !text.starts_with("--")
        && !word.contains(&text.to_ascii_lowercase().as_str());
    if safe {
        text.to_owned()
    } else {
        Value::from(text).to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WOVEN: &str = include_str!("../../../../workflows/materials/woven-38616.yaml");
    const NCF: &str = include_str!("../../../../workflows/materials/ncf-fcim359.yaml");

    #[test]
    fn nothing_but_the_new_block_changes_in_a_material() {
        for text in [WOVEN, NCF] {
            let template = Template::parse(text, "old.yaml").unwrap();
            let new = json!({"linear": "0.0001 N m", "asymptote": "0.01 N", "scale": "5 1/m"});
            let blocks: [Block<'_>; 1] = [(&["bending", "positive"], Some(new.clone()))];
            let (name, text) = file(
                Some(&template),
                &blocks,
                "bending.yaml",
                &["Measured.".into()],
            )
            .unwrap();
            assert_eq!(name, "material.yaml");
            assert!(
                text.starts_with("# Measured.\n# New here: bending.positive."),
                "{text}"
            );
            let mut expected = template.value.clone();
            expected["with"]["bending"]["positive"] = new;
            let old = expected["source"].as_str().unwrap_or_default();
            expected["source"] = json!(format!("{old}; bending.positive: Measured"));
            assert_eq!(
                Template::parse(&text, "new").unwrap().value,
                expected,
                "{text}"
            );
        }
    }

    #[test]
    fn a_block_may_be_taken_away_and_a_fragment_stands_alone() {
        let template = Template::parse(NCF, "old.yaml").unwrap();
        let (_, text) = file(Some(&template), &[(&["stitch"], None)], "f", &[]).unwrap();
        assert!(!text.contains("stitch:"), "{text}");
        let (name, text) = file(
            None,
            &[(&["bending", "positive"], Some(json!({"linear": "1 N m"})))],
            "bending.yaml",
            &[],
        )
        .unwrap();
        assert_eq!(name, "bending.yaml");
        assert!(
            text.ends_with("bending:\n  positive: {linear: 1 N m}\n"),
            "{text}"
        );
    }

    #[test]
    fn a_bending_law_that_the_material_would_refuse_beside_the_template_is_refused() {
        let bare = "plyflow_material: 1\nname: n\nplugin: material-fabric\nthickness: 0.4 mm\nareal_mass: 440 g/m2\n\
                    with:\n  fibre_modulus: 3 GPa\n";
        let put = |bending: &str, sign: &str| {
            let template = Template::parse(&format!("{bare}{bending}"), "old.yaml").unwrap();
            let law = Some(json!({"linear": "1 N m"}));
            file(Some(&template), &[(&["bending", sign], law)], "f", &[])
        };
        let families = "  bending:\n    family_1: {positive: {stiffness: 1 N m}}\n    family_2: {positive: {stiffness: 1 N m}}\n";
        for sign in ["positive", "negative"] {
            let e = put(families, sign).unwrap_err();
            assert!(
                e.starts_with("old.yaml: has bending laws of each family"),
                "{e}"
            );
        }
        for bending in ["", "  bending: {families: opposite}\n"] {
            let e = put(bending, "negative").unwrap_err();
            assert!(e.contains("`bending.positive`"), "{e}");
            assert!(put(bending, "positive").is_ok());
        }
        // An empty block is none: it takes a law, and is no law beside which another could stand.
        let (_, text) = put("  bending:\n", "positive").unwrap();
        assert!(text.contains("positive: {linear: 1 N m}"), "{text}");
        let e = put("  bending: {positive: }\n", "negative").unwrap_err();
        assert!(e.contains("has no `bending.positive`"), "{e}");
        let both = "  bending: {positive: {stiffness: 1 N m}}\n";
        assert!(put(both, "negative").is_ok());
    }

    #[test]
    fn texts_that_yaml_would_read_as_something_else_are_quoted() {
        for (given, expected) in [
            ("0.19457 N mm", "0.19457 N mm"),
            ("-4.5e-3 1/mm", "-4.5e-3 1/mm"),
            ("5", "\"5\""),
            ("no", "\"no\""),
            ("a: b", "\"a: b\""),
            ("", "\"\""),
            ("a, b", "\"a, b\""),
        ] {
            assert_eq!(scalar(given), expected);
        }
    }

    #[test]
    fn numbers_keep_six_digits() {
        assert_eq!(quantity(0.19457e-3, 1e-3, "N mm"), "0.19457 N mm");
        assert_eq!(quantity(-3539.561234, 1.0, "N/m"), "-3539.56 N/m");
        assert_eq!(significant(1.23456789e-12), "1.23457e-12");
        assert_eq!(significant(0.0), "0");
    }

    #[test]
    fn what_is_no_material_is_refused() {
        assert!(
            Template::parse("a: [", "x")
                .unwrap_err()
                .contains("x: is no YAML")
        );
        assert!(
            Template::parse("a: 1", "x")
                .unwrap_err()
                .contains("x: is no material file")
        );
        let other = |plugin: &str| {
            let text = NCF.replace("plugin: material-fabric", &format!("plugin: {plugin}"));
            Template::parse(&text, "x")
        };
        for plugin in ["material-marlow", "material-isotropic", "./libother.so"] {
            let e = other(plugin).unwrap_err();
            assert!(
                e.starts_with(&format!("x: its plugin is `{plugin}`"))
                    && e.contains("`plugin: material-fabric`"),
                "{e}"
            );
        }
        assert!(other("../target/release/libplyflow_material_fabric.so").is_ok());
        assert!(areal_mass(None, None).unwrap_err().contains("areal_mass"));
    }
}
