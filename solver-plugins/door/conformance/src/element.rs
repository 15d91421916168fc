//! Checks of an element formulation: its calls, its buffers, its lanes.

use crate::breaches::{Ask, Breaches, Refusal};
use crate::check::{Check, Sink};
use crate::neighbours::{self, mixed, of_lanes};
use crate::run::{Run, Seen};
use crate::sequence::Sequence;
use crate::shapes::Elements;
use crate::subject::{Answer, Masses, Motion, STRAIN, State, Subject};
use crate::{element_motion, meeting, patch, rules, tapes};
use plyflow_sdk::abi::*;

/// Lanes of the sets that the mechanics are judged on.
const LANES: usize = 16;

/// Checks an element formulation made with `parameters` (JSON, SI numbers) for a material: its element part and,
/// when it has one, its patch part. `fields` are the numbers of element and patch fields in its manifest; `None`
/// when they are not known.
///
/// An element may refuse a material, with a text: then the check `create` is skipped and nothing else is made. The
/// caller sees to it that some material is accepted.
///
/// # Safety
/// `functions` must be a whole table and `material` a whole material, valid for the length of the call; what their functions do is under test.
#[must_use]
pub unsafe fn check_element(
    functions: *const pf_element_functions,
    parameters: &str,
    fields: Option<[usize; 2]>,
    material: &pf_material,
    sink: &mut dyn Sink,
) -> Vec<Check> {
    let mut run = Run::new(sink);
    // SAFETY: valid for this call (the caller's promise), which no subject outlives.
    let create = || unsafe { Subject::create(functions, parameters, material) };
    let (mut subject, mut twin) = (None, None);
    run.check(rules::CREATE, || match (create(), create()) {
        (Ok(a), Ok(b)) => {
            (subject, twin) = (Some(a), Some(b));
            Seen::Well("made twice from the same parameters".into())
        }
        (Err(Refusal::Said(text)), _) => Seen::Nothing(format!(
            "it refuses this material or these parameters: {text}"
        )),
        (Err(Refusal::Broken(text)), _) => Seen::Bad(text),
        (_, Err(refusal)) => Seen::Bad(format!("a second instance: {}", refusal.text())),
    });
    if let (Some(subject), Some(twin)) = (&subject, &twin)
        && run.check(rules::SIZES, || sizes(subject, fields))
        && calls(&mut run, subject)
    {
        run.check(rules::REPEATABLE, || repeatable(subject, twin));
        run.check(rules::LANES, || lanes(subject));
        run.check(rules::ASKING, || asking(subject));
        run.check(rules::THREADS, || threads(subject));
        run.check(rules::TAPE, || tapes::forces(subject));
        element_motion::judge(&mut run, subject, LANES);
        patch::judge(&mut run, subject, twin);
    }
    run.finish()
}

fn sizes(subject: &Subject, fields: Option<[usize; 2]>) -> Seen {
    let s = &subject.sizes;
    let given = format!(
        "{} nodes, {} degrees of freedom, {} constants, {} history, {} material points, {} fields; \
         patch: {} nodes, {} constants, {} history, {} fields",
        s.nodes,
        s.dofs_per_node,
        s.constants,
        s.history,
        s.material_points,
        s.fields,
        s.patch_nodes,
        s.patch_constants,
        s.patch_history,
        s.patch_fields
    );
    let bad = |why: &str| Seen::Bad(format!("{why}: {given}"));
    let largest = [s.constants, s.history, s.patch_constants, s.patch_history];
    if !matches!(s.nodes, 3 | 4) {
        return bad("an element part has 3 or 4 nodes");
    }
    if !matches!(s.dofs_per_node, 3 | 6) {
        return bad("a node has 3 or 6 degrees of freedom");
    }
    if largest.iter().any(|n| *n > 100_000) || s.material_points > 1000 || s.patch_nodes > 1000 {
        return bad("a size makes no sense");
    }
    if s.patch_nodes > 0 && !subject.has_patch_functions() {
        return bad("patch nodes without patch_initialise and patch_forces");
    }
    if s.patch_nodes > 32 {
        return bad("the solver takes patches of up to 32 nodes");
    }
    match fields {
        Some(names) if names != [s.fields as usize, s.patch_fields as usize] => Seen::Bad(format!(
            "the manifest names {} element fields and {} patch fields, sizes says {} and {}",
            names[0], names[1], s.fields, s.patch_fields
        )),
        // The contract leaves room for triangles; whoever writes one learns here what runs it.
        _ if s.nodes == 3 => Seen::Well(format!(
            "{given}; note: plyflow.h allows 3 nodes, but this solver takes quads only"
        )),
        _ => Seen::Well(given),
    }
}

/// The calls as such: status, guard zones, whole and finite outputs. Whether the rest can be judged.
fn calls(run: &mut Run<'_>, subject: &Subject) -> bool {
    let made = "20 batches of 8 to 64 elements, strains to 30 %";
    run.calls(made, &rules::OF_ELEMENTS, || {
        let mut all = Breaches::default();
        for (lanes, strain) in [(8, 0.0), (8, STRAIN), (24, STRAIN), (64, STRAIN), (64, 0.3)] {
            for ask in Ask::ALL {
                let elements = Elements::new(subject.nodes(), lanes, 11);
                all.add(subject.once(&elements, strain, ask).2.breaches);
            }
        }
        all
    })
}

/// Everything that a call gave, as bits by lane.
pub(crate) fn bits(state: &State, masses: &Masses, a: &Answer, l: usize) -> Vec<u64> {
    let rows = [
        state.constants.slice(),
        state.history.slice(),
        state.material_history.slice(),
        &masses.mass,
        &masses.inertia,
        &a.force,
        &a.moment,
        &a.energy,
        &a.fields,
        &a.step,
    ];
    rows.into_iter()
        .flat_map(|r| r.chunks_exact(state.lanes).map(|row| row[l].to_bits()))
        .collect()
}

fn repeatable(subject: &Subject, twin: &Subject) -> Seen {
    let elements = Elements::new(subject.nodes(), LANES, 13);
    let first = subject.once(&elements, STRAIN, Ask::EVERYTHING);
    for (which, again) in [("the same", subject), ("another", twin)] {
        let second = again.once(&elements, STRAIN, Ask::EVERYTHING);
        for l in 0..LANES {
            if bits(&first.0, &first.1, &first.2, l) != bits(&second.0, &second.1, &second.2, l) {
                return Seen::Bad(format!(
                    "lane {l} differs in a second call of {which} instance"
                ));
            }
        }
    }
    Seen::Well("same bits in a second call and in a second instance".into())
}

fn lanes(subject: &Subject) -> Seen {
    let all = Elements::new(subject.nodes(), neighbours::ALL, 17);
    let positions = mixed(&[
        all.deformed(0.1, 23),
        all.deformed(0.002, 19),
        all.deformed(1e-9, 29),
    ]);
    // Rotations in a step (rad), after one without: what a run does, what it may do, and nearly none. A series that ends early still rounds
    // as the sine does when the angle is small enough: a hundredth is not.
    let turning = |angle: f64, seed: u64| -> Vec<f64> {
        let mut s = Sequence(seed);
        (0..positions.len()).map(|_| angle * s.next()).collect()
    };
    let spins = mixed(&[turning(0.4, 41), turning(1e-2, 43), turning(1e-9, 47)]);
    neighbours::judge(|order| {
        let elements = all.picked(order);
        let (x, spin) = (of_lanes(&positions, order), of_lanes(&spins, order));
        let (mut state, masses) = subject.initialise(&elements);
        let motion = |spin| Motion {
            from: Some(&elements.reference[..]),
            spin,
        };
        let still = subject.forces(&mut state, &x, motion(None), Ask::EVERYTHING);
        let turned = subject.forces(&mut state, &x, motion(Some(&spin)), Ask::EVERYTHING);
        (0..order.len())
            .map(|l| {
                let mut all = bits(&state, &masses, &still, l);
                all.extend(bits(&state, &masses, &turned, l));
                all
            })
            .collect()
    })
}

fn asking(subject: &Subject) -> Seen {
    let elements = Elements::new(subject.nodes(), LANES, 13);
    let all = subject.once(&elements, STRAIN, Ask::EVERYTHING);
    for ask in Ask::ALL {
        let some = subject.once(&elements, STRAIN, ask);
        let mut want = all.2.clone();
        if !ask.fields {
            want.fields.clear();
        }
        if !ask.bound {
            want.step.clear();
        }
        let differs = (0..LANES)
            .find(|l| bits(&all.0, &all.1, &want, *l) != bits(&some.0, &some.1, &some.2, *l));
        if let Some(l) = differs {
            let told = ask.told("critical_step");
            return Seen::Bad(format!("lane {l}: another answer when {told}"));
        }
    }
    Seen::Well("same bits with and without fields and critical_step, each alone too".into())
}

fn threads(subject: &Subject) -> Seen {
    // From a state at the deformed position.
    let start = |thread: usize| {
        let set = Elements::new(subject.nodes(), LANES, 101 + 2 * thread as u64);
        let state = subject.once(&set, STRAIN, Ask::NOTHING).0;
        (state, set.deformed(STRAIN, 7))
    };
    let alone = |(state, x): &(State, Vec<f64>), ask| {
        let mut after = state.clone();
        let answer = subject.forces(&mut after, x, Motion::default(), ask);
        (after, answer)
    };
    meeting::judge(start, alone, |(state, x), ask, want, counter| {
        subject.hammer((state, x), ask, want, counter)
    })
}
