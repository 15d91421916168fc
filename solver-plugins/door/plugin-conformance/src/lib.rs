//! The step `plugin-conformance`: runs the checks of `plyflow-conformance` on components that the host finds.
//! `plyflow check-plugin` runs it in a process of its own.
//!
//! Every beginning and end of a check is logged at once, as `conformance: ` and one JSON object, so that they are
//! known even when the component ends the process: `{"subject": "..", "begins": {rule}}` and
//! `{"subject": "..", "ends": {check}}`. A check that fails does not fail the step: the result `failed` counts.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_conformance::{Check, Outcome, Rule, Sink, check_element, check_material};
use plyflow_model::artifact::{CONFORMANCE_MARK, Conformance, ConformanceLine, ConformanceSubject};
use plyflow_model::material::Material;
use plyflow_sdk::abi::*;
use plyflow_sdk::{Host, Log, Step, StepError, export_step};
use serde::Deserialize;
use serde_json::Value;

/// The step.
pub struct PluginConformance;

#[derive(Deserialize)]
struct Component {
    plugin: String,
    #[serde(default)]
    with: Value,
}

#[derive(Deserialize)]
struct Parameters {
    element: Option<Component>,
    materials: Vec<Material>,
}

/// Tells the host's log of every check as it goes.
struct Teller<'a> {
    host: &'a Host,
    subject: String,
}

impl Teller<'_> {
    fn tell(&self, begins: Option<&Rule>, ends: Option<&Check>) {
        let line = ConformanceLine {
            subject: self.subject.clone(),
            begins: begins.map(Rule::told),
            ends: ends.map(Check::told),
        };
        if let Ok(line) = serde_json::to_string(&line) {
            self.host
                .log(Log::Info, &format!("{CONFORMANCE_MARK}{line}"));
        }
    }
}

impl Sink for Teller<'_> {
    fn begins(&mut self, rule: &Rule) {
        self.tell(Some(rule), None);
    }

    fn ends(&mut self, check: &Check) {
        self.tell(None, Some(check));
    }
}

impl Step for PluginConformance {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        if p.materials.is_empty() {
            return Err("materials: the list is empty; give at least one material".into());
        }
        let mut subjects = Vec::new();
        let mut refused = 0;
        let mut count = [0usize; 3];
        for material in &p.materials {
            host.check_cancelled()?;
            let subject = match &p.element {
                Some(element) => format!("{} with {}", element.plugin, material.name),
                None => format!("{}: {}", material.plugin, material.name),
            };
            let mut teller = Teller { host, subject };
            let mut checks = match &p.element {
                Some(element) => judge_element(host, element, material, &mut teller)?,
                None => judge_material(host, material, &mut teller)?,
            };
            // An element may refuse a material, but not all of them.
            let only = checks.len() == 1 && checks[0].outcome == Outcome::Skipped;
            refused += usize::from(only);
            if refused == p.materials.len() {
                let mut check = checks[0].clone();
                check.outcome = Outcome::Failed;
                check.seen = format!("no material is accepted; {}", check.seen);
                teller.ends(&check);
                checks.push(check);
            }
            for check in &checks {
                count[match check.outcome {
                    Outcome::Passed => 0,
                    Outcome::Failed => 1,
                    Outcome::Skipped => 2,
                }] += 1;
            }
            subjects.push(ConformanceSubject {
                subject: teller.subject,
                checks: checks.iter().map(Check::told).collect(),
            });
        }
        host.write_attributes(&Conformance { subjects })?;
        for (name, n) in ["passed", "failed", "skipped"].into_iter().zip(count) {
            host.result(name, n as f64, "1")?;
        }
        Ok(())
    }
}

/// The parameters of a material's `create`.
fn parameters(material: &Material) -> String {
    let mut with = Value::Object(material.with.clone());
    with["thickness"] = material.thickness.si().into();
    with["areal_mass"] = material.areal_mass.si().into();
    with.to_string()
}

fn judge_material(
    host: &Host,
    material: &Material,
    sink: &mut dyn Sink,
) -> Result<Vec<Check>, StepError> {
    let found = host.component(PF_KIND_MATERIAL, &material.plugin)?;
    // SAFETY: the host gives the table of a material for a material, valid until the process ends (plyflow.h).
    Ok(unsafe { check_material(found.functions.cast(), &parameters(material), sink) })
}

fn judge_element(
    host: &Host,
    element: &Component,
    material: &Material,
    sink: &mut dyn Sink,
) -> Result<Vec<Check>, StepError> {
    let functions = host
        .component(PF_KIND_MATERIAL, &material.plugin)?
        .functions;
    let functions: *const pf_material_functions = functions.cast();
    let found = host.component(PF_KIND_ELEMENT, &element.plugin)?;
    let text = parameters(material);
    let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
    // SAFETY: the host's table of a material, valid until the process ends; a text, room for the instance and a whole `pf_error`.
    let code =
        unsafe { ((*functions).create)(pf_str::new(&text), &raw mut instance, &raw mut error) };
    if code != PF_OK {
        return Err(format!("material '{}': {}", material.name, error.get()).into());
    }
    if instance.is_null() {
        let text = "its `create` returned PF_OK and left the instance NULL";
        return Err(format!("material '{}': {text}", material.name).into());
    }
    let made = pf_material {
        functions,
        instance,
    };
    let with = if element.with.is_null() {
        "{}".to_owned()
    } else {
        element.with.to_string()
    };
    // SAFETY: a text of the host's, valid until `run` returns.
    let fields = unsafe { found.manifest.as_str() }.map_or(None, declared_fields);
    // SAFETY: the host's table of an element, and the material that was made above.
    let checks = unsafe { check_element(found.functions.cast(), &with, fields, &made, sink) };
    // SAFETY: made above, ended once; the elements that had it are gone.
    unsafe { ((*functions).destroy)(instance) };
    Ok(checks)
}

/// Numbers of element and of patch fields in a manifest: none where it names none.
fn declared_fields(manifest: &str) -> Option<[usize; 2]> {
    let manifest: Value = serde_json::from_str(manifest).ok()?;
    let none = Vec::new();
    let fields = match manifest.get("fields") {
        Some(fields) => fields.as_array()?,
        None => &none,
    };
    let patch = fields.iter().filter(|f| f["patch"] == true).count();
    Some([fields.len() - patch, patch])
}

export_step!(PluginConformance);
