//! Checks of a material: its calls, its buffers, its lanes.

use crate::breaches::{Ask, Breaches, Refusal};
use crate::buffer::Guarded;
use crate::check::{Check, Rule, Sink};
use crate::law::{Answer, LANES, Law, STRAIN, metrics, trellis, undeformed, zero_dt};
use crate::neighbours::{self, ALL, mixed, of_lanes};
use crate::run::{Run, Seen};
use crate::{bending, material_law, meeting, rules, tapes};
use plyflow_sdk::abi::*;

/// Checks a material made with `parameters` (JSON, SI numbers, with `thickness` and `areal_mass`): its membrane part
/// and, when it has one, its bending.
///
/// # Safety
/// `functions` must be a whole table that is valid for the length of the call; what its functions do is under test.
#[must_use]
pub unsafe fn check_material(
    functions: *const pf_material_functions,
    parameters: &str,
    sink: &mut dyn Sink,
) -> Vec<Check> {
    let mut run = Run::new(sink);
    // SAFETY: valid for this call (the caller's promise), which no law outlives.
    let create = || unsafe { Law::create(functions, parameters) };
    let (mut law, mut twin) = (None, None);
    run.check(rules::CREATE, || match (create(), create()) {
        (Ok(a), Ok(b)) => {
            (law, twin) = (Some(a), Some(b));
            Seen::Well("made twice from the same parameters".into())
        }
        (Err(refusal), _) | (_, Err(refusal)) => Seen::Bad(refusal.text().to_owned()),
    });
    if let (Some(law), Some(twin)) = (&law, &twin)
        && run.check(
            Rule {
                expected: "thickness and areal mass are those of the parameters, bending is there when has_bending is 1",
                remedy: "take thickness and areal_mass from the parameters: the mesh's masses rest on them",
                ..rules::SIZES
            },
            || sizes(functions, parameters, law),
        )
    {
        if calls(&mut run, law) {
            judge(&mut run, law, twin);
        }
        bending::judge(&mut run, law, twin);
    }
    run.finish()
}

fn sizes(functions: *const pf_material_functions, parameters: &str, law: &Law) -> Seen {
    let s = &law.sizes;
    let given = format!(
        "thickness {} m, areal mass {} kg/m2, {} membrane and {} bending history, has_bending {}",
        s.thickness, s.areal_mass, s.membrane_history, s.bending_history, s.has_bending
    );
    let positive = s.thickness > 0.0 && s.areal_mass > 0.0;
    let sane = s.membrane_history.max(s.bending_history) < 10_000 && s.has_bending <= 1;
    if !(positive && sane && (s.has_bending == 0 || law.functions().bending.is_some())) {
        return Seen::Bad(given);
    }
    let Ok(mut with) = serde_json::from_str::<serde_json::Value>(parameters) else {
        return Seen::Bad("the parameters are no JSON".into());
    };
    if let Some(text) = other_sheet(&with, law) {
        return Seen::Bad(text);
    }
    // Numbers that happen to be those of the plugin's source say nothing: another sheet of the same law.
    for (name, factor) in [("thickness", 1.25), ("areal_mass", 1.5)] {
        if let Some(value) = with[name].as_f64() {
            with[name] = (factor * value).into();
        }
    }
    // SAFETY: valid for the length of `check_material` (its caller's promise), which calls this.
    match unsafe { Law::create(functions, &with.to_string()) } {
        Ok(other) => match other_sheet(&with, &other) {
            Some(text) => Seen::Bad(text),
            None => Seen::Well(given),
        },
        Err(Refusal::Said(text)) => Seen::Well(format!(
            "{given}; a sheet of 1.25 times the thickness is refused: {text}"
        )),
        Err(Refusal::Broken(text)) => Seen::Bad(format!("with 1.25 times the thickness: {text}")),
    }
}

/// How the sizes differ from the parameters, if they do.
fn other_sheet(parameters: &serde_json::Value, law: &Law) -> Option<String> {
    let sizes = [
        ("thickness", law.sizes.thickness, "m"),
        ("areal_mass", law.sizes.areal_mass, "kg/m2"),
    ];
    sizes.into_iter().find_map(|(name, got, unit)| {
        let want = parameters[name].as_f64()?;
        // Single precision inside is no fault.
        let differs = (got - want).abs() > 1e-6 * want.abs();
        differs.then(|| format!("{name} is {got} {unit}, the parameters say {want} {unit}"))
    })
}

fn calls(run: &mut Run<'_>, law: &Law) -> bool {
    let made = "10 batches of 8 to 64 lanes, strains to 30 %, shear to 60 degrees";
    run.calls(made, &rules::OF_MATERIALS, || {
        let mut all = Breaches::default();
        for (lanes, strain) in [(8, 0.0), (8, STRAIN), (24, STRAIN), (64, STRAIN), (64, 0.3)] {
            for ask in [Ask::NOTHING, Ask::EVERYTHING] {
                let mut history = law.start(lanes);
                let rest = law.membrane(&mut history, &undeformed(lanes), ask);
                all.add(rest.breaches);
                for metric in [metrics(lanes, strain, 61), trellis(lanes)] {
                    all.add(law.membrane(&mut history, &metric, ask).breaches);
                }
            }
        }
        all
    })
}

/// Rest, then a state; everything that it gave.
fn once(law: &Law, metric: &[f64], ask: Ask) -> (Guarded, Answer) {
    let lanes = metric.len() / 3;
    let mut history = law.start(lanes);
    let _ = law.membrane(&mut history, &undeformed(lanes), ask);
    let a = law.membrane(&mut history, metric, ask);
    (history, a)
}

fn bits(history: &Guarded, a: &Answer, lanes: usize, l: usize) -> Vec<u64> {
    let rows = [history.slice(), &a.stress, &a.energy, &a.stiffness];
    rows.into_iter()
        .flat_map(|r| r.chunks_exact(lanes).map(|row| row[l].to_bits()))
        .collect()
}

fn judge(run: &mut Run<'_>, law: &Law, twin: &Law) {
    let metric = metrics(LANES, STRAIN, 67);
    let all = |law: &Law, metric: &[f64]| -> Vec<Vec<u64>> {
        let (history, a) = once(law, metric, Ask::EVERYTHING);
        let lanes = metric.len() / 3;
        (0..lanes).map(|l| bits(&history, &a, lanes, l)).collect()
    };
    run.check(rules::REPEATABLE, || {
        let first = all(law, &metric);
        if first == all(law, &metric) && first == all(twin, &metric) {
            Seen::Well("same bits in a second call and in a second instance".into())
        } else {
            Seen::Bad("a second call on the same data differs".into())
        }
    });
    run.check(rules::LANES, || {
        let metric = mixed(&[trellis(ALL), metrics(ALL, 0.05, 71), metrics(ALL, 1e-9, 73)]);
        neighbours::judge(|order| all(law, &of_lanes(&metric, order)))
    });
    run.check(rules::ASKING, || {
        let mut with = once(law, &metric, Ask::EVERYTHING);
        let without = once(law, &metric, Ask::NOTHING);
        with.1.stiffness.clear();
        let same = |l| bits(&with.0, &with.1, LANES, l) == bits(&without.0, &without.1, LANES, l);
        if (0..LANES).all(same) {
            Seen::Well("same bits with and without stiffness".into())
        } else {
            Seen::Bad("stress, energy or history differ when stiffness is NULL".into())
        }
    });
    run.check(rules::THREADS, || threads(law));
    run.check(rules::TAPE, || tapes::membrane(law));
    run.check(rules::ZERO_DT, || {
        zero_dt(|dt| {
            let mut history = law.start(LANES);
            let rest = law.membrane_after(0.0, &mut history, &undeformed(LANES), Ask::NOTHING);
            let a = law.membrane_after(dt, &mut history, &metric, Ask::EVERYTHING);
            let outputs = vec![a.stress, a.energy, a.stiffness];
            (rest.breaches, a.breaches, outputs)
        })
    });
    material_law::judge(run, law);
}

fn threads(law: &Law) -> Seen {
    let start = |thread: usize| {
        let metric = metrics(LANES, STRAIN, 201 + 2 * thread as u64);
        let mut history = law.start(LANES);
        let _ = law.membrane(&mut history, &undeformed(LANES), Ask::NOTHING);
        (history, metric)
    };
    let alone = |(history, metric): &(Guarded, Vec<f64>), ask| {
        let mut after = history.clone();
        let answer = law.membrane(&mut after, metric, ask);
        (after, answer)
    };
    meeting::judge(start, alone, |(history, metric), ask, want, counter| {
        law.hammer((history, metric), ask, want, counter)
    })
}
