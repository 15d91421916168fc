//! Tapes: what a component says that it does to one lane, beside what it does.

use crate::breaches::{Ask, DT};
use crate::law::{Law, metrics, trellis, undeformed};
use crate::run::Seen;
use crate::sequence::Sequence;
use crate::shapes::{Elements, Patches};
use crate::subject::{Motion, Subject};
use plyflow_sdk::abi::*;
use plyflow_tape::{Buffer, Tape};
use std::ffi::c_void;

pub(crate) const LANES: usize = 64;
/// Most bytes that are taken of a text.
const MOST: usize = 16 << 20;

/// A buffer by its name in the batch: `[rows][lanes]`, or one number that all lanes share.
pub(crate) type Rows<'a> = (&'static str, &'a [f64]);

/// Takes a piece of a text.
unsafe extern "C" fn take(host: *mut c_void, piece: pf_str) {
    // SAFETY: the text that `read` made this writer for, in its call.
    let text = unsafe { &mut *host.cast::<Result<String, String>>() };
    // SAFETY: plyflow.h asks of a piece that it is there for the call.
    let piece = unsafe { piece.as_str() };
    let Ok(so_far) = text else { return };
    match piece {
        Ok(piece) if so_far.len() + piece.len() <= MOST => so_far.push_str(piece),
        Ok(_) => *text = Err(format!("its text has more than {MOST} bytes")),
        Err(e) => *text = Err(format!("its text is not UTF-8: {e}")),
    }
}

/// The tape that a call gives, if it gives one.
fn read(call: impl FnOnce(*const pf_writer, *mut pf_error) -> i32) -> Result<Option<Tape>, String> {
    let mut text: Result<String, String> = Ok(String::new());
    let to = pf_writer {
        host: (&raw mut text).cast(),
        write: take,
    };
    let mut error = pf_error::default();
    match call(&raw const to, &raw mut error) {
        PF_OK => Tape::read(&text?).map(Some).map_err(|fault| fault.0),
        PF_NOT_FOUND => Ok(None),
        code => Err(format!("tape returned {code}: {}", error.get())),
    }
}

/// The tape of a material's function.
///
/// # Safety
/// `functions` is a whole table and `instance` one that it made, both there for the call.
unsafe fn of_material(
    functions: *const pf_material_functions,
    instance: *const c_void,
    what: u32,
) -> Result<Option<Tape>, String> {
    // SAFETY: the caller's promise.
    let Some(tape) = (unsafe { (*functions).tape }) else {
        return Ok(None);
    };
    // SAFETY: the caller's promise; a writer and room for a text.
    read(|to, error| unsafe { tape(instance, what, to, error) })
}

/// The rows of a name.
fn rows<'a>(of: &[Rows<'a>], name: &str) -> Option<&'a [f64]> {
    of.iter().find(|r| r.0 == name).map(|r| r.1)
}

/// A slice for each buffer of a tape: what the function was given, or room for what it writes.
fn slices(
    tape: &Tape,
    lanes: usize,
    given: &[Rows<'_>],
    wanted: &[Rows<'_>],
) -> Result<Vec<Vec<f64>>, String> {
    if let Some(call) = tape.calls.first() {
        return Err(format!("it calls '{}', as elements alone do", call.of));
    }
    // A device would write it too.
    let mut stored = (tape.stores.iter()).map(|s| &tape.buffers[s.to.buffer as usize].name);
    if let Some(name) = stored.find(|name| rows(wanted, name).is_none()) {
        return Err(format!("it writes '{name}', which its function does not"));
    }
    let one = |b: &Buffer| {
        let room = || rows(wanted, &b.name).map(|rows| vec![f64::NAN; rows.len()]);
        let slice = rows(given, &b.name).map(<[f64]>::to_vec).or_else(room);
        let slice = slice
            .ok_or_else(|| format!("it has a buffer '{}', which its function has not", b.name))?;
        if slice.len() == b.rows as usize * if b.uniform { 1 } else { lanes } {
            return Ok(slice);
        }
        Err(format!(
            "its buffer '{}' has {} rows{}; the function's has {} numbers for {lanes} lanes",
            b.name,
            b.rows,
            if b.uniform { ", uniform" } else { "" },
            slice.len()
        ))
    };
    tape.buffers.iter().map(one).collect()
}

/// Runs a tape on what the function was given and holds it against what it wrote, in the lanes that count.
pub(crate) fn held(
    tape: &Tape,
    lanes: usize,
    given: &[Rows<'_>],
    wanted: &[Rows<'_>],
    counts: impl Fn(usize) -> bool,
) -> Result<(), String> {
    let mut slices = slices(tape, lanes, given, wanted)?;
    let mut now: Vec<&mut [f64]> = slices.iter_mut().map(|s| &mut s[..]).collect();
    let _ = tape.run(lanes, &mut now);
    for (name, wanted) in wanted {
        let at = tape.buffers.iter().position(|b| b.name == *name);
        // What a tape does not name stays as it was.
        let Some(gave) = at.map(|i| &slices[i][..]).or_else(|| rows(given, name)) else {
            if wanted.is_empty() {
                continue;
            }
            return Err(format!("it does not write '{name}'"));
        };
        let differs = |i: &usize| {
            gave[*i].to_bits() != wanted[*i].to_bits()
                && !(gave[*i].is_nan() && wanted[*i].is_nan())
        };
        if let Some(i) = (0..wanted.len())
            .filter(|i| counts(i % lanes))
            .find(differs)
        {
            return Err(format!(
                "row {} of '{name}' in lane {}: the function gives {:e}, the tape {:e}",
                i / lanes,
                i % lanes,
                wanted[i],
                gave[i]
            ));
        }
    }
    Ok(())
}

/// What is said where there is no tape: it or its material gives none.
fn none() -> Seen {
    Seen::Well("none is given: it runs where it can be called".into())
}

/// What is seen of a component whose tape, where there is one, is held against its function in so many states.
pub(crate) fn over(
    tape: Result<Option<Tape>, String>,
    states: impl FnOnce(&Tape) -> Result<usize, String>,
) -> Seen {
    match tape {
        Ok(None) => none(),
        Ok(Some(tape)) => match states(&tape) {
            Ok(states) => Seen::Well(format!("the same bits in {states} states")),
            Err(text) => Seen::Bad(text),
        },
        Err(text) => Seen::Bad(text),
    }
}

/// The tape of one of a law's functions.
pub(crate) fn of_law(law: &Law, what: u32) -> Result<Option<Tape>, String> {
    // SAFETY: the law's own table and instance.
    unsafe { of_material(law.functions(), law.instance(), what) }
}

/// The membrane of a law, over states that follow each other.
pub(crate) fn membrane(law: &Law) -> Seen {
    over(of_law(law, PF_TAPE_MEMBRANE), |tape| {
        let (mut history, mut states) = (law.start(LANES), 0);
        for i in 0..8 {
            let random = |size: f64| metrics(LANES, size, 301 + 2 * i);
            let strained = [random(0.002), random(0.05), random(0.3)];
            for metric in [undeformed(LANES), trellis(LANES)]
                .into_iter()
                .chain(strained)
            {
                let before = history.slice().to_vec();
                let a = law.membrane(&mut history, &metric, Ask::EVERYTHING);
                let given: [Rows<'_>; 3] =
                    [("metric", &metric), ("history", &before), ("dt", &[DT])];
                let wanted: [Rows<'_>; 4] = [
                    ("stress", &a.stress),
                    ("energy", &a.energy),
                    ("stiffness", &a.stiffness),
                    ("history", history.slice()),
                ];
                held(tape, LANES, &given, &wanted, |_| true)?;
                states += LANES;
            }
        }
        Ok(states)
    })
}

/// An element's tape with those of its material in it.
fn whole(subject: &Subject, what: u32, count: u32) -> Result<Option<Tape>, String> {
    let Some(own) = read_or_none(subject, what, count)? else {
        return Ok(None);
    };
    let of = |what| {
        let material = subject.material();
        // SAFETY: the subject's own material, a whole one (`Subject::create`).
        unsafe { of_material(material.functions, material.instance, what) }
    };
    let (membrane, bending) = (of(PF_TAPE_MEMBRANE)?, of(PF_TAPE_BENDING)?);
    let asks = |name: &str| own.calls.iter().any(|c| c.of == name);
    if (asks("membrane") && membrane.is_none()) || (asks("bending") && bending.is_none()) {
        return Ok(None);
    }
    let tape = own.with_calls(|name| match name {
        "membrane" => membrane.as_ref(),
        "bending" => bending.as_ref(),
        _ => None,
    });
    tape.map(Some).map_err(|fault| fault.0)
}

fn read_or_none(subject: &Subject, what: u32, count: u32) -> Result<Option<Tape>, String> {
    let Some(tape) = subject.functions().tape else {
        return Ok(None);
    };
    // SAFETY: the subject's own table and instance; a writer and room for a text.
    read(|to, error| unsafe { tape(subject.instance(), what, count, to, error) })
}

/// The forces of an element, over states that follow each other.
pub(crate) fn forces(subject: &Subject) -> Seen {
    over(whole(subject, PF_TAPE_FORCES, 0), |tape| {
        let mut states = 0;
        for i in 0..4 {
            let elements = Elements::new(subject.nodes(), LANES, 401 + 2 * i);
            let (mut state, _) = subject.initialise(&elements);
            for (strain, turn) in [
                (0.0, 0.0),
                (1e-3, 1e-4),
                (0.02, 0.01),
                (0.1, 0.4),
                (0.3, 2.0),
            ] {
                let x = elements.deformed(strain, 403 + 2 * i);
                let mut s = Sequence(405 + 2 * i);
                let angle: Vec<f64> = x.iter().map(|_| turn * s.next()).collect();
                let per_second = |of: f64| of / DT;
                let velocity: Vec<f64> = x
                    .iter()
                    .zip(&elements.reference)
                    .map(|(b, a)| per_second(b - a))
                    .collect();
                let spin: Vec<f64> = angle.iter().map(|a| per_second(*a)).collect();
                let before = state.clone();
                let motion = Motion {
                    from: Some(&elements.reference),
                    spin: Some(&angle),
                };
                let a = subject.forces(&mut state, &x, motion, Ask::NOTHING);
                let given: [Rows<'_>; 7] = [
                    ("position", &x),
                    ("velocity", &velocity),
                    ("spin", &spin),
                    ("constants", before.constants.slice()),
                    ("history", before.history.slice()),
                    ("material_history", before.material_history.slice()),
                    ("dt", &[DT]),
                ];
                let wanted: [Rows<'_>; 5] = [
                    ("force", &a.force),
                    ("moment", &a.moment),
                    ("energy", &a.energy),
                    ("history", state.history.slice()),
                    ("material_history", state.material_history.slice()),
                ];
                held(tape, LANES, &given, &wanted, |_| true)?;
                states += LANES;
            }
        }
        Ok(states)
    })
}

/// The forces of patches, a tape for each number of nodes that there is.
pub(crate) fn patch_forces(subject: &Subject) -> Seen {
    let Some(patches) = Patches::new(subject.nodes(), subject.slots(), LANES, 407) else {
        return none();
    };
    let mut counts: Vec<u32> = patches.count.iter().map(|n| *n as u32).collect();
    counts.sort_unstable();
    counts.dedup();
    let mut states = 0;
    for count in counts {
        let seen = over(whole(subject, PF_TAPE_PATCH_FORCES, count), |tape| {
            let (mut state, _) = subject.patch_initialise(&patches);
            let of_count = |l: usize| patches.count[l] as u32 == count;
            for i in 0..8 {
                let x = if i == 0 {
                    patches.reference.clone()
                } else {
                    patches.bent(409 + 2 * i)
                };
                let before = state.clone();
                let a = subject.patch_forces(&mut state, &x, DT, Ask::NOTHING);
                let given: [Rows<'_>; 4] = [
                    ("position", &x),
                    ("constants", before.constants.slice()),
                    ("history", before.history.slice()),
                    ("dt", &[DT]),
                ];
                let wanted: [Rows<'_>; 3] = [
                    ("force", &a.force),
                    ("energy", &a.energy),
                    ("history", state.history.slice()),
                ];
                held(tape, LANES, &given, &wanted, of_count)?;
                states += (0..LANES).filter(|l| of_count(*l)).count();
            }
            Ok(states)
        });
        if !matches!(seen, Seen::Well(_)) {
            return seen;
        }
    }
    match states {
        0 => none(),
        _ => Seen::Well(format!("the same bits in {states} states")),
    }
}
