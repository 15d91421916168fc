//! How far the ways to the answer are from the reference: the fine runs of the zones, the coarse run by itself, and others.

use crate::models::{Model, PassedOver};
use plyflow_defects::pairs::{PairErrors, Pairs, apart, measure_for_pairs};
use plyflow_defects::sizes::{SizeClasses, SizeErrors};
use plyflow_defects::{Defect, FieldErrors, Settings};
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{self, Role, Yardstick, Zone};
use plyflow_sdk::{Host, StepError};

/// A defect and the name of its ply.
type Found<'a> = (&'a str, &'a Defect);

/// What some models have of the reference's defects: names of results, values and units, in the order in which they are reported.
fn defects(
    ours: &[Found<'_>],
    theirs: &[Found<'_>],
    settings: &Settings,
    classes: &SizeClasses,
) -> Vec<Told> {
    let [a, b] = [ours, theirs].map(|all| all.iter().map(|f| f.1).collect::<Vec<_>>());
    let on_one_ply = |i: usize, j: usize| (ours[i].0 == theirs[j].0).then(|| apart(a[i], b[j]));
    let pairs = Pairs::of(&a, &b, settings, on_one_ply);
    let told = PairErrors::of(&a, &b, &pairs).told();
    let by_pair = told.into_iter().map(|(name, v)| (name.to_owned(), v));
    let by_size = SizeErrors::of(&a, &b, &pairs, classes).told();
    (by_pair.chain(by_size))
        .map(|(name, v)| (name, v, "1"))
        .collect()
}

/// Name of a result, its value and its unit.
type Told = (String, f64, &'static str);

/// A way to the answer, measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// Its model: `global`, `other.drape`; `total` for global and local runs together.
    pub model: String,
    /// Behind the names of its results: `.global`, `.other.drape`, nothing for `total`.
    suffix: String,
    errors: Vec<Told>,
    elements: usize,
    element_cycles: f64,
    began_late: Option<f64>,
}

impl Way {
    /// Of some models, not measured yet.
    fn new(model: &str, suffix: &str, models: &[&Model]) -> Self {
        Self {
            model: model.to_owned(),
            suffix: suffix.to_owned(),
            errors: Vec::new(),
            elements: models.iter().map(|m| m.elements).sum(),
            element_cycles: models.iter().fold(0.0, |s, m| s + m.element_cycles),
            // Of a whole only: zones that begin late stand on the global run, which is in their cost.
            began_late: match models {
                [whole] if matches!(whole.role, Role::Other | Role::Reference) => whole.began_late,
                _ => None,
            },
        }
    }

    /// As the attributes have it.
    pub fn told(&self) -> artifact::Way {
        let errors = self.errors.iter();
        artifact::Way {
            model: self.model.clone(),
            elements: self.elements,
            element_cycles: self.element_cycles,
            start_time: self.began_late,
            errors: errors.map(|(name, v, _)| (name.clone(), *v)).collect(),
        }
    }
}

/// Writes what was measured of the ways, and of the single local runs, as results.
///
/// # Errors
/// When the host refuses a result.
pub fn write(host: &Host, ways: &[Way]) -> Result<(), StepError> {
    for way in ways {
        for (name, value, unit) in &way.errors {
            host.result(&format!("{name}{}", way.suffix), *value, unit)?;
        }
    }
    Ok(())
}

/// What the ways to the answer are measured by; `None` when nothing was refined.
pub fn yardstick(models: &[Model]) -> Option<Yardstick> {
    let has = |role| models.iter().any(|m| m.role == role);
    if has(Role::Reference) {
        Some(Yardstick::Reference)
    } else {
        has(Role::Local).then_some(Yardstick::Zones)
    }
}

/// The ways and the single local runs, each with how far it is from the reference, in the order in which they are reported.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Measured {
    /// Whole answers: the global run by itself, every other run, the local runs with the global run around them, and the reference.
    pub ways: Vec<Way>,
    /// The fields of each local run.
    pub local: Vec<Way>,
}

/// Measures how far every way to the answer is from the reference: the local runs together (with the global run around them), the
/// global run by itself, and every other run. All defects of the reference count, wherever they are. Without a reference the
/// local runs stand in for it, and what lies outside of their zones does not count. Nothing when nothing was refined. `classes`: by which errors are told
/// by size, besides. Runs that are `passed_over` are
/// not measured, and count among the element cycles of what stands on them.
///
/// # Errors
/// When the run is cancelled.
pub fn measure_ways(
    host: &Host,
    models: &[Model],
    passed_over: &PassedOver,
    zones: &[Zone],
    settings: &Settings,
    classes: &SizeClasses,
) -> Result<Measured, StepError> {
    let Some(yardstick) = yardstick(models) else {
        return Ok(Measured::default());
    };
    let of = |role| -> Vec<&Model> { models.iter().filter(|m| m.role == role).collect() };
    let (global, local) = (of(Role::Global), of(Role::Local));
    let reference = match yardstick {
        Yardstick::Reference => of(Role::Reference),
        Yardstick::Zones => local.clone(),
    };
    let theirs = defects_of(&reference, zones, yardstick, settings);
    let theirs = named(&theirs);
    let both: Vec<&Model> = local.iter().chain(&global).copied().collect();
    // Whose defects count, and whose fields, the first that has a place.
    let way = |model: &str, suffix: &str, all: &[&Model]| Way::new(model, suffix, all);
    let mut ways = vec![(
        way("global", ".global", &global),
        global.clone(),
        global.clone(),
    )];
    for m in of(Role::Other) {
        let suffix = format!(".{}", m.name);
        ways.push((way(&m.name, &suffix, &[m]), vec![m], vec![m]));
    }
    if yardstick == Yardstick::Reference {
        ways.push((way("total", "", &both), local.clone(), both.clone()));
    }
    let mut measured = Measured::default();
    for (mut way, models, around) in ways {
        host.check_cancelled()?;
        let ours = defects_of(&models, zones, yardstick, settings);
        let ours = named(&ours);
        way.errors = defects(&ours, &theirs, settings, classes);
        way.errors.extend(fields(&around, &reference, zones));
        measured.ways.push(way);
    }
    // The yardstick itself, for what it took.
    measured.ways.push(match yardstick {
        Yardstick::Reference => Way::new("reference", ".reference", &reference),
        Yardstick::Zones => Way::new("total", "", &both),
    });
    add_costs(&mut measured.ways, models, passed_over);
    if yardstick == Yardstick::Reference {
        for m in local {
            let mut way = Way::new(&m.name, &format!(".{}", m.name), &[m]);
            way.errors = fields(&[m], &reference, zones);
            measured.local.push(way);
        }
    }
    Ok(measured)
}

/// Adds to each way what was run on the way to it, as in its costs.
fn add_costs(ways: &mut [Way], models: &[Model], passed_over: &PassedOver) {
    let late = passed_over.global_began_late(models);
    for way in ways {
        if matches!(way.model.as_str(), "global" | "total") {
            way.began_late = late;
        }
        way.element_cycles += match way.model.as_str() {
            "global" => passed_over.earlier_cycles,
            "total" => passed_over.earlier_cycles + passed_over.superseded_cycles,
            _ => 0.0,
        };
    }
}

/// How far the fields of a way are from the reference; from fine runs of zones that stand in for it, each in its zone.
fn fields(way: &[&Model], reference: &[&Model], zones: &[Zone]) -> Vec<Told> {
    let counts =
        |run: usize, at: &[f64]| reference[run].zone.is_none_or(|z| zones[z].holds(at, 0.0));
    let [way, plies] =
        [way, reference].map(|all| all.iter().map(|m| &m.plies[..]).collect::<Vec<_>>());
    let Some(errors) = FieldErrors::of(&way, &plies, counts) else {
        return Vec::new();
    };
    let told = [
        ("position_error", Some(errors.position), "m"),
        ("distance_error", errors.distance, "m"),
        ("shear_quantile_error", errors.shear, "rad"),
    ];
    let known = |(name, value, unit): (&str, Option<f64>, _)| Some((name.to_owned(), value?, unit));
    told.into_iter().filter_map(known).collect()
}

/// The defects of all plies of some models, by ply, also the smaller ones that a pair may need: of a local run those in its zone, and without
/// a reference those of any other run in all zones.
fn defects_of(
    models: &[&Model],
    zones: &[Zone],
    yardstick: Yardstick,
    settings: &Settings,
) -> Vec<(String, Vec<Defect>)> {
    let counts = |m: &Model, at: &Vec3| match (yardstick, m.zone) {
        // The mesh of a zone reaches past it, to the nearest lines of the whole's.
        (_, Some(own)) => zones[own].holds(at, 0.0),
        (Yardstick::Reference, None) => true,
        (Yardstick::Zones, None) => zones.iter().any(|z| z.holds(at, 0.0)),
    };
    let mut found = Vec::new();
    for m in models {
        for p in &m.plies {
            let inside: Vec<bool> = p.undeformed.iter().map(|at| counts(m, at)).collect();
            found.push((p.name.clone(), measure_for_pairs(p, &inside, settings)));
        }
    }
    found
}

fn named(found: &[(String, Vec<Defect>)]) -> Vec<Found<'_>> {
    found
        .iter()
        .flat_map(|(ply, defects)| defects.iter().map(move |d| (ply.as_str(), d)))
        .collect()
}
