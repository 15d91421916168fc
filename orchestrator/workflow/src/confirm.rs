//! `--confirm`: the steps that run the zones of a workflow again in other ways, and the step that follows their defects, put into the
//! tree of the workflow as if they stood in its file.

use crate::catalog::Plugins;
use crate::diagnostics::{Problems, Source};
use crate::resolved::{Confirming, LeftOut, VariantStep};
use crate::yaml::{Entry, Kind, Node, Span};
use plyflow_model::artifact::Variation;
use plyflow_model::nearest::nearest;
use std::f64::consts::SQRT_2;

/// Parameters of a comparison that the step `confirm` has too: what counts as a defect.
const SHARED: [&str; 6] = [
    "distance_threshold",
    "curvature_threshold",
    "crest_hold",
    "foot_margin",
    "minimum_wrinkle_length",
    "minimum_bridging_area",
];
/// Name of the step that follows the defects, and of its plugin.
const CONFIRM: &str = "confirm";
/// By how much slower a process goes on, wider a margin is, and more often a step is taken.
const TWICE: f64 = 2.0;

/// Reads which variants are asked for: names with commas between them, or `all`.
///
/// # Errors
/// The name that is none of a variant, and the nearest.
pub fn variants_of(text: &str) -> Result<Vec<Variation>, String> {
    if text.trim() == "all" {
        return Ok(Variation::ALL.to_vec());
    }
    let mut chosen = Vec::new();
    for name in text.split(',').map(|n| n.trim().replace('-', "_")) {
        let Some(variant) = Variation::ALL.into_iter().find(|v| v.name() == name) else {
            let names = Variation::ALL.map(Variation::name);
            let near =
                nearest(&name, names).map_or(String::new(), |n| format!(" (did you mean `{n}`?)"));
            return Err(format!(
                "`{name}` is no variant{near}; expected some of {}, with commas between them",
                names.join(", ")
            ));
        };
        if !chosen.contains(&variant) {
            chosen.push(variant);
        }
    }
    chosen.sort_unstable();
    Ok(chosen)
}

/// The steps of which variants are made, by name.
struct Chain {
    comparison: String,
    global: String,
    zones: String,
    boundary: String,
    local: String,
}

/// What is added where something is to be confirmed; the outer `None`: something is missing (and reported).
pub(crate) fn wanted(
    root: &mut Node,
    chosen: &[Variation],
    source: &Source,
    catalog: &Plugins<'_>,
    problems: &mut Problems,
) -> Option<Option<Confirming>> {
    match chosen {
        [] => Some(None),
        chosen => expand(root, chosen, source, catalog, problems).map(Some),
    }
}

/// Puts the steps of the variants and the step `confirm` into the tree of a workflow. `None`: something is missing (and reported).
fn expand(
    root: &mut Node,
    chosen: &[Variation],
    source: &Source,
    catalog: &Plugins<'_>,
    problems: &mut Problems,
) -> Option<Confirming> {
    for key in ["study", "optimise"] {
        if let Some(e) = root.entry(key).filter(|e| e.value.kind != Kind::Null) {
            let message = format!("`--confirm` for a workflow with `{key}`");
            let d = problems.add(source, &e.key_span, message);
            d.expected("a workflow that runs its steps once")
                .help("copy the workflow without this block, with the values of the point that matters, and confirm that one");
            return None;
        }
    }
    let steps = root.get("steps")?;
    let chain = chain(steps, source, problems)?;
    let mut added = Added {
        steps,
        chain: &chain,
        entries: Vec::new(),
        confirming: Confirming::default(),
        time_step: default_of("forming-explicit", "time_step", source, catalog)
            .and_then(|v| v.as_str().map(str::to_owned)),
        scale: default_of("zone-extraction", "scale", source, catalog).and_then(|v| v.as_f64()),
    };
    for variant in Variation::ALL {
        if chosen.contains(&variant) {
            added.variant(variant);
        } else {
            added.leave_out(variant, "it was not asked for");
        }
    }
    added.confirm();
    let Added {
        entries,
        confirming,
        ..
    } = added;
    for entry in &entries {
        if let Some(taken) = steps.entry(&entry.key) {
            let message = format!(
                "`--confirm` adds a step `{}`, and the workflow has one of that name",
                entry.key
            );
            let d = problems.add(source, &taken.key_span, message);
            d.expected("another name for this step, or a run without `--confirm`");
            return None;
        }
    }
    if let Some(Kind::Map(all)) = entry_mut(root, "steps").map(|e| &mut e.value.kind) {
        all.extend(entries);
    }
    Some(confirming)
}

/// The last entry of a mapping with a key.
fn entry_mut<'n>(node: &'n mut Node, key: &str) -> Option<&'n mut Entry> {
    match &mut node.kind {
        Kind::Map(entries) => entries.iter_mut().rev().find(|e| e.key == key),
        _ => None,
    }
}

/// The default of a parameter of a plugin, as it is written.
fn default_of(
    plugin: &str,
    parameter: &str,
    source: &Source,
    catalog: &Plugins<'_>,
) -> Option<serde_json::Value> {
    let entry = catalog.find(plugin, &source.folder).ok()?;
    entry.manifest.parameters.get(parameter)?.default.clone()
}

fn plugin_of(step: &Node) -> &str {
    step.get("plugin").and_then(Node::text).unwrap_or_default()
}

/// The steps that arrive at a port.
fn givers<'n>(step: &'n Node, port: &str) -> Vec<&'n str> {
    let Some(given) = step.get("from").and_then(|f| f.get(port)) else {
        return Vec::new();
    };
    let one = given.text().into_iter();
    one.chain(given.items().iter().filter_map(Node::text))
        .collect()
}

/// The chain of a workflow that is confirmed: that of its comparisons, if they agree on one.
fn chain(steps: &Node, source: &Source, problems: &mut Problems) -> Option<Chain> {
    let comparisons: Vec<&Entry> = (steps.entries().iter())
        .filter(|e| plugin_of(&e.value) == "comparison")
        .collect();
    let wanted = "a chain zone-extraction -> boundary-interpolation -> forming-explicit -> comparison, as in workflows/joggle-spar/workflow.yaml";
    let Some(first) = comparisons.first() else {
        let message = "`--confirm` for a workflow without a comparison of fine runs of zones";
        problems.add(source, &steps.span, message).expected(wanted);
        return None;
    };
    let mut found: Vec<Chain> = Vec::new();
    let mut missing = None;
    for entry in &comparisons {
        match chain_of(steps, entry) {
            Ok(chain) => {
                let same = |c: &Chain| {
                    (&c.zones, &c.boundary, &c.local)
                        == (&chain.zones, &chain.boundary, &chain.local)
                };
                if !found.iter().any(same) {
                    found.push(chain);
                }
            }
            Err(why) => missing = missing.or(Some((entry, why))),
        }
    }
    match (found.len(), missing) {
        (1, None) => found.pop(),
        // Of zones that are drawn again a first comparison is not the answer.
        (_, Some((entry, why))) => {
            let message = format!("`--confirm` cannot make variants of `{}`: {why}", entry.key);
            let d = problems.add(source, &entry.key_span, message);
            d.expected(wanted).help("write the steps of the variants and a step `confirm` into the workflow by hand (docs/guide/confirm.md)");
            None
        }
        _ => {
            let names: Vec<String> = found
                .iter()
                .map(|c| format!("`{}`", c.comparison))
                .collect();
            let message = format!(
                "`--confirm` for a workflow with comparisons of different zones: {}",
                names.join(", ")
            );
            let d = problems.add(source, &first.key_span, message);
            d.expected("one").help("write the steps of the variants and a step `confirm` into the workflow by hand (docs/guide/confirm.md)");
            None
        }
    }
}

/// The chain that ends with a comparison, or what of it is missing.
fn chain_of(steps: &Node, comparison: &Entry) -> Result<Chain, String> {
    let one = |step: &Entry, port: &str, plugin: Option<&str>| -> Result<String, String> {
        let name = match givers(&step.value, port)[..] {
            [one] => one.to_owned(),
            [] => return Err(format!("nothing arrives at `{port}` of `{}`", step.key)),
            [..] => {
                return Err(format!(
                    "several steps arrive at `{port}` of `{}`",
                    step.key
                ));
            }
        };
        let giver = steps.get(&name).map(plugin_of).unwrap_or_default();
        match plugin.filter(|p| *p != giver) {
            Some(wanted) => Err(format!(
                "`{port}` of `{}` comes from `{name}`, a step of `{giver}` and not of `{wanted}`",
                step.key
            )),
            None => Ok(name),
        }
    };
    let entry = |name: &str| {
        steps
            .entry(name)
            .ok_or_else(|| format!("there is no step `{name}`"))
    };
    let global = one(comparison, "global", None)?;
    let zones = one(comparison, "zones", Some("zone-extraction"))?;
    let local = one(comparison, "local", Some("forming-explicit"))?;
    let boundary = one(entry(&local)?, "boundary", Some("boundary-interpolation"))?;
    let of_boundary = one(entry(&boundary)?, "zones", None)?;
    if of_boundary != zones {
        return Err(format!(
            "`zones` of `{boundary}` comes from `{of_boundary}`, that of the comparison from `{zones}`"
        ));
    }
    one(entry(&zones)?, "defects", None)?;
    Ok(Chain {
        comparison: comparison.key.clone(),
        global,
        zones,
        boundary,
        local,
    })
}

/// Steps that are being added.
struct Added<'n> {
    steps: &'n Node,
    chain: &'n Chain,
    entries: Vec<Entry>,
    confirming: Confirming,
    /// Default of the step in time.
    time_step: Option<String>,
    /// Default of the scale of zones.
    scale: Option<f64>,
}

impl Added<'_> {
    fn leave_out(&mut self, variant: Variation, why: &str) {
        let why = why.to_owned();
        self.confirming.left_out.push(LeftOut { variant, why });
    }

    /// The steps of a variant.
    fn variant(&mut self, variant: Variation) {
        let Chain {
            zones,
            boundary,
            local,
            ..
        } = self.chain;
        let named = |step: &str| format!("{step}_{}", variant.name());
        let (new_zones, new_boundary) = (named(zones), named(boundary));
        match variant {
            Variation::Finer => {
                self.add(variant, boundary, TWICE, |s| s.multiply("finer", SQRT_2));
                self.add(variant, local, TWICE * SQRT_2, |s| {
                    s.rewire("boundary", &new_boundary);
                    s.divide_step(SQRT_2);
                });
            }
            Variation::Slower => {
                self.add(variant, boundary, 1.0, |s| s.multiply("slower", TWICE));
                self.add(variant, local, TWICE, |s| {
                    s.rewire("boundary", &new_boundary)
                });
            }
            Variation::HalfStep => self.add(variant, local, TWICE, |s| s.divide_step(TWICE)),
            Variation::Wider => {
                let advised = self.steps.get(boundary).map(|b| givers(b, "meshes"));
                if advised.is_some_and(|m| !m.is_empty()) {
                    let why =
                        "the element sizes that `meshes` advises are those of the narrower zones";
                    return self.leave_out(variant, why);
                }
                let area = self.wider_area();
                self.add(variant, zones, 1.0, |s| s.multiply("wider", TWICE));
                self.add(variant, boundary, area, |s| {
                    s.rewire("zones", &new_zones);
                    s.fan_over(zones, &new_zones);
                });
                self.add(variant, local, area, |s| {
                    s.rewire("boundary", &new_boundary);
                    s.fan_over(zones, &new_zones);
                });
            }
        }
    }

    /// About how much larger wider zones are (1): where the scale makes their margins.
    fn wider_area(&self) -> f64 {
        let with = self
            .steps
            .get(&self.chain.zones)
            .and_then(|z| z.get("with"));
        let scale = with
            .and_then(|w| w.get("scale"))
            .and_then(|s| s.to_json().as_f64());
        let scale = scale.or(self.scale).unwrap_or(1.0).max(1.0);
        ((1.0 + TWICE * (scale - 1.0)) / scale).powi(2)
    }

    /// Adds the variant of a step, which costs about `factor` times as much.
    fn add(
        &mut self,
        variant: Variation,
        of: &str,
        factor: f64,
        change: impl FnOnce(&mut Changed<'_>),
    ) {
        let Some(entry) = self.steps.entry(of) else {
            return;
        };
        let mut copy = entry.clone();
        copy.key = format!("{of}_{}", variant.name());
        let mut changed = Changed {
            span: copy.key_span.clone(),
            node: &mut copy.value,
            time_step: self.time_step.as_deref(),
        };
        change(&mut changed);
        self.confirming.steps.push(VariantStep {
            name: copy.key.clone(),
            of: of.to_owned(),
            variant,
            factor,
        });
        self.entries.push(copy);
    }

    /// The step that follows the defects through the variants.
    fn confirm(&mut self) {
        let Some(comparison) = self.steps.entry(&self.chain.comparison) else {
            return;
        };
        let span = &comparison.key_span;
        let text = |t: &str| node(Kind::Text(t.to_owned()), span);
        let mut from = vec![
            ("global", self.chain.global.clone()),
            ("zones", self.chain.zones.clone()),
            ("local", self.chain.local.clone()),
        ];
        for step in &self.confirming.steps {
            if step.of == self.chain.local {
                from.push((step.variant.name(), step.name.clone()));
            }
        }
        let from = from
            .iter()
            .map(|(port, step)| entry(port, text(step), span));
        let mut step = vec![
            entry("plugin", text(CONFIRM), span),
            entry("from", node(Kind::Map(from.collect()), span), span),
        ];
        let with = comparison.value.get("with").map_or(&[][..], Node::entries);
        let shared = with.iter().filter(|e| SHARED.contains(&e.key.as_str()));
        let shared: Vec<Entry> = shared.cloned().collect();
        if !shared.is_empty() {
            step.push(entry("with", node(Kind::Map(shared), span), span));
        }
        self.entries
            .push(entry(CONFIRM, node(Kind::Map(step), span), span));
        self.confirming.step = CONFIRM.to_owned();
    }
}

fn node(kind: Kind, span: &Span) -> Node {
    Node {
        kind,
        span: span.clone(),
    }
}

fn entry(key: &str, value: Node, span: &Span) -> Entry {
    Entry {
        key: key.to_owned(),
        key_span: span.clone(),
        value,
    }
}

/// A copy of a step that is being changed.
struct Changed<'n> {
    node: &'n mut Node,
    /// Where what is new counts as written.
    span: Span,
    time_step: Option<&'n str>,
}

impl Changed<'_> {
    /// The value of a parameter, made if need be.
    fn parameter(&mut self, name: &str) -> Option<&mut Node> {
        let span = self.span.clone();
        let with = value_mut(self.node, "with", || node(Kind::Map(Vec::new()), &span))?;
        if with.kind == Kind::Null {
            with.kind = Kind::Map(Vec::new());
        }
        value_mut(with, name, || node(Kind::Null, &span))
    }

    /// Multiplies a number, which is 1 where it is not given.
    fn multiply(&mut self, name: &str, factor: f64) {
        let Some(value) = self.parameter(name) else {
            return;
        };
        let given = match &value.kind {
            Kind::Null => Some(1.0),
            Kind::Number(n) => n.as_f64(),
            // What is no number is told where the file gives it.
            _ => None,
        };
        let product = given
            .map(|v| rounded(v * factor))
            .and_then(serde_json::Number::from_f64);
        if let Some(product) = product {
            value.kind = Kind::Number(product);
        }
    }

    /// Divides the step in time.
    fn divide_step(&mut self, by: f64) {
        let default = self.time_step.map(str::to_owned);
        let Some(value) = self.parameter("time_step") else {
            return;
        };
        let given = match &value.kind {
            Kind::Null => default,
            Kind::Text(text) => Some(text.clone()),
            _ => None,
        };
        if let Some(divided) = given.and_then(|text| divided(&text, by)) {
            value.kind = Kind::Text(divided);
        }
    }

    /// Takes a port from another step.
    fn rewire(&mut self, port: &str, from: &str) {
        if let Some(e) = entry_mut(self.node, "from").and_then(|e| entry_mut(&mut e.value, port)) {
            e.value.kind = Kind::Text(from.to_owned());
        }
    }

    /// Fans out over another collection.
    fn fan_over(&mut self, old: &str, new: &str) {
        let Some(Kind::Map(all)) = entry_mut(self.node, "for_each").map(|e| &mut e.value.kind)
        else {
            return;
        };
        for e in all.iter_mut().filter(|e| e.value.text() == Some(old)) {
            e.value.kind = Kind::Text(new.to_owned());
        }
    }
}

/// The value of a key of a mapping, made if there is none.
fn value_mut<'n>(
    node: &'n mut Node,
    key: &str,
    make: impl FnOnce() -> Node,
) -> Option<&'n mut Node> {
    let Kind::Map(entries) = &mut node.kind else {
        return None;
    };
    let at = match entries.iter().rposition(|e| e.key == key) {
        Some(at) => at,
        None => {
            let value = make();
            let key_span = value.span.clone();
            entries.push(Entry {
                key: key.to_owned(),
                key_span,
                value,
            });
            entries.len() - 1
        }
    };
    Some(&mut entries[at].value)
}

/// Six digits: what a user would write.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// A quantity as text, divided; `None` for what is none.
fn divided(text: &str, by: f64) -> Option<String> {
    let text = text.trim();
    let unit = text.rfind(|c: char| c.is_ascii_digit() || c == '.')? + 1;
    let number: f64 = text[..unit].trim().parse().ok()?;
    Some(format!("{} {}", rounded(number / by), text[unit..].trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_are_read_by_name_and_a_slip_is_told_with_the_nearest() {
        assert_eq!(variants_of("all").unwrap(), Variation::ALL);
        let some = variants_of("half-step, finer,finer").unwrap();
        assert_eq!(some, [Variation::Finer, Variation::HalfStep]);
        let wrong = variants_of("fine").unwrap_err();
        assert!(
            wrong.contains("did you mean `finer`?") && wrong.contains("half_step"),
            "{wrong}"
        );
    }

    #[test]
    fn a_quantity_is_divided_in_its_own_unit() {
        assert_eq!(divided("3 us", 2.0).unwrap(), "1.5 us");
        assert_eq!(divided("1e-5 s", 2.0).unwrap(), "0.000005 s");
        assert_eq!(divided("10us", SQRT_2).unwrap(), "7.07107 us");
        assert_eq!(divided("${dt}", 2.0), None);
        assert_eq!(divided("fast", 2.0), None);
    }
}
