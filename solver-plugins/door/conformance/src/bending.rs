//! Checks of a material's bending part.

use crate::breaches::{Ask, Breaches, DT};
use crate::buffer::Guarded;
use crate::cycle::Cycles;
use crate::law::{LANES, Law, largest, metrics, size, undeformed, zero_dt};
use crate::meeting::{self, CALLS, Counter, same};
use crate::neighbours::{self, ALL, mixed, of_lanes};
use crate::rules;
use crate::run::{Run, Seen, worse};
use crate::sequence::Sequence;
use crate::slope::Energies;
use crate::tapes;
use plyflow_fixed::FixedBits;
use plyflow_sdk::abi::*;

/// Curvatures of gentle folds (1/m): a radius of 20 mm.
const GENTLE: f64 = 50.0;
/// Those of sharp ones: a radius of 2 mm.
const SHARP: f64 = 500.0;
/// Steps from flat to a bent state: laws that integrate want small ones.
const STEPS: usize = 60;

/// The largest curvatures that a law is judged at (1/m): radii of less than five thicknesses are no bending of a sheet.
fn sharp(law: &Law) -> f64 {
    SHARP.min(0.2 / law.sizes.thickness).max(GENTLE)
}

struct Answer {
    moment: Vec<f64>,
    energy: Vec<f64>,
    tangent: Vec<f64>,
    breaches: Breaches,
}

fn start(law: &Law, lanes: usize) -> Guarded {
    Guarded::zeros(law.sizes.bending_history as usize * lanes)
}

fn call(law: &Law, history: &mut Guarded, metric: &[f64], curvature: &[f64], ask: Ask) -> Answer {
    let sheet = Sheet { metric, curvature };
    call_after(DT, law, history, sheet, ask)
}

/// What bending is called with: `[3][lanes]` each, curvatures in 1/m.
#[derive(Clone, Copy)]
struct Sheet<'a> {
    metric: &'a [f64],
    curvature: &'a [f64],
}

/// Calls bending with another time since the previous call.
fn call_after(
    dt: f64,
    law: &Law,
    history: &mut Guarded,
    Sheet { metric, curvature }: Sheet<'_>,
    ask: Ask,
) -> Answer {
    let lanes = metric.len() / 3;
    let (mut c, mut k) = (Guarded::of(metric), Guarded::of(curvature));
    let mut moment = Guarded::poisoned(3 * lanes);
    let mut energy = Guarded::poisoned(lanes);
    let mut tangent = Guarded::poisoned(if ask.bound { 3 * lanes } else { 0 });
    let batch = pf_bending_batch {
        size: size_of::<pf_bending_batch>() as u64,
        lanes: lanes as u32,
        reserved: 0,
        dt,
        metric: c.pointer(),
        curvature: k.pointer(),
        history: history.pointer(),
        moment: moment.pointer(),
        energy: energy.pointer(),
        tangent: if ask.bound {
            tangent.pointer()
        } else {
            std::ptr::null_mut()
        },
    };
    let mut b = Breaches::default();
    let name = "bending";
    if let Some(bending) = law.functions().bending {
        // SAFETY: the law's own instance, and a batch with the guarded buffers that plyflow.h asks of this call, of the lengths for its sizes.
        b.status(name, unsafe { bending(law.instance(), &raw const batch) });
    }
    b.unchanged(name, "metric", &c, metric);
    b.unchanged(name, "curvature", &k, curvature);
    b.zones(name, "history", history);
    b.output(name, "moment", &moment, lanes);
    b.output(name, "energy", &energy, lanes);
    b.output(name, "tangent", &tangent, lanes);
    Answer {
        moment: moment.slice().to_vec(),
        energy: energy.slice().to_vec(),
        tangent: tangent.slice().to_vec(),
        breaches: b,
    }
}

fn curvatures(lanes: usize, largest: f64, seed: u64) -> Vec<f64> {
    let mut s = Sequence(seed);
    (0..3 * lanes).map(|_| largest * s.next()).collect()
}

/// Flat, then bent; everything that it gave.
fn bend(law: &Law, metric: &[f64], curvature: &[f64], ask: Ask) -> (Guarded, Answer) {
    let mut history = start(law, metric.len() / 3);
    let _ = call(law, &mut history, metric, &vec![0.0; metric.len()], ask);
    let a = call(law, &mut history, metric, curvature, ask);
    (history, a)
}

fn bits(history: &Guarded, a: &Answer, lanes: usize) -> Vec<Vec<u64>> {
    let rows = [history.slice(), &a.moment, &a.energy, &a.tangent];
    (0..lanes)
        .map(|l| {
            let of = |r: &&[f64]| -> Vec<u64> {
                let rows = r.chunks_exact(lanes);
                rows.map(|row| row[l].to_bits()).collect()
            };
            rows.iter().flat_map(of).collect()
        })
        .collect()
}

/// The law's tape beside it, over states that follow each other.
fn tape(law: &Law) -> Seen {
    tapes::over(tapes::of_law(law, PF_TAPE_BENDING), |tape| {
        let lanes = tapes::LANES;
        let (mut history, mut states) = (start(law, lanes), 0);
        for i in 0..16 {
            let metric = metrics(lanes, 0.02, 501 + 2 * i);
            let largest = [0.0, 1e-3, GENTLE, sharp(law)][i as usize % 4];
            let curvature = curvatures(lanes, largest, 503 + 2 * i);
            let before = history.slice().to_vec();
            let a = call(law, &mut history, &metric, &curvature, Ask::EVERYTHING);
            let given: [tapes::Rows<'_>; 4] = [
                ("metric", &metric),
                ("curvature", &curvature),
                ("history", &before),
                ("dt", &[DT]),
            ];
            let wanted: [tapes::Rows<'_>; 4] = [
                ("moment", &a.moment),
                ("energy", &a.energy),
                ("tangent", &a.tangent),
                ("history", history.slice()),
            ];
            tapes::held(tape, lanes, &given, &wanted, |_| true)?;
            states += lanes;
        }
        Ok(states)
    })
}

pub(crate) fn judge(run: &mut Run<'_>, law: &Law, twin: &Law) {
    if !law.bends() {
        return;
    }
    let well = run.check(rules::BENDING, || {
        let mut all = Breaches::default();
        for lanes in [8, 24, 64] {
            // Its one optional output.
            for ask in [Ask::NOTHING, Ask::EVERYTHING] {
                let mut history = start(law, lanes);
                for (seed, largest) in [(89, GENTLE), (97, sharp(law))] {
                    let m = metrics(lanes, 0.02, seed);
                    let k = curvatures(lanes, largest, seed);
                    all.add(call(law, &mut history, &m, &k, ask).breaches);
                }
            }
        }
        match all.any() {
            Some(text) => Seen::Bad(text),
            None => Seen::Well(format!(
                "12 batches of 8 to 64 lanes, curvatures to {:.0} 1/m",
                sharp(law)
            )),
        }
    });
    if !well {
        run.skip(&rules::OF_BENDING, "not checked: repair the above first");
        return;
    }
    run.check(rules::BENDING_REPEATABLE, || repeatable(law, twin));
    run.check(rules::BENDING_LANES, || lanes(law));
    run.check(rules::BENDING_ASKING, || asking(law));
    run.check(rules::BENDING_THREADS, || threads(law));
    run.check(rules::BENDING_TAPE, || tape(law));
    run.check(rules::BENDING_ZERO_DT, || {
        let (m, k) = (metrics(LANES, 0.02, 107), curvatures(LANES, GENTLE, 109));
        let sheet = |curvature| Sheet {
            metric: &m,
            curvature,
        };
        let (flat, bent) = (sheet(&[0.0; 3 * LANES]), sheet(&k));
        zero_dt(|dt| {
            let mut history = start(law, LANES);
            let rest = call_after(0.0, law, &mut history, flat, Ask::NOTHING);
            let a = call_after(dt, law, &mut history, bent, Ask::EVERYTHING);
            let outputs = vec![a.moment, a.energy, a.tangent];
            (rest.breaches, a.breaches, outputs)
        })
    });
    run.check(rules::BENDING_REST, || rest(law));
    run.check(rules::MOMENT, || moment(law));
    run.check(rules::BENDING_CYCLE, || cycle(law));
    run.check(rules::BENDING_TANGENT, || tangent(law));
}

fn repeatable(law: &Law, twin: &Law) -> Seen {
    let (m, k) = (metrics(LANES, 0.02, 101), curvatures(LANES, GENTLE, 103));
    let all = |law: &Law| {
        let (history, a) = bend(law, &m, &k, Ask::EVERYTHING);
        bits(&history, &a, LANES)
    };
    let first = all(law);
    if first == all(law) && first == all(twin) {
        Seen::Well("same bits in a second call and in a second instance".into())
    } else {
        Seen::Bad("a second call on the same data differs".into())
    }
}

fn lanes(law: &Law) -> Seen {
    let m = mixed(&[
        metrics(ALL, 0.02, 101),
        metrics(ALL, 1e-3, 105),
        undeformed(ALL),
    ]);
    let k = mixed(&[
        curvatures(ALL, sharp(law), 103),
        curvatures(ALL, 1.0, 107),
        curvatures(ALL, 1e-6, 109),
    ]);
    neighbours::judge(|order| {
        let (m, k) = (of_lanes(&m, order), of_lanes(&k, order));
        let (history, a) = bend(law, &m, &k, Ask::EVERYTHING);
        bits(&history, &a, order.len())
    })
}

fn asking(law: &Law) -> Seen {
    let (m, k) = (metrics(LANES, 0.02, 101), curvatures(LANES, GENTLE, 103));
    let mut with = bend(law, &m, &k, Ask::EVERYTHING);
    let without = bend(law, &m, &k, Ask::NOTHING);
    with.1.tangent.clear();
    if bits(&with.0, &with.1, LANES) == bits(&without.0, &without.1, LANES) {
        Seen::Well("same bits with and without tangent".into())
    } else {
        Seen::Bad("moment, energy or history differ when tangent is NULL".into())
    }
}

/// As [`Law::hammer`], of bending.
fn hammer(
    law: &Law,
    (history, metric, curvature): (&Guarded, &[f64], &[f64]),
    ask: Ask,
    (after, want): &(Guarded, Answer),
    counter: &Counter<'_>,
) -> usize {
    let Some(bending) = law.functions().bending else {
        return 0;
    };
    let lanes = metric.len() / 3;
    let (mut c, mut k) = (Guarded::of(metric), Guarded::of(curvature));
    let mut now = history.clone();
    let (mut moment, mut energy) = (Guarded::zeros(3 * lanes), Guarded::zeros(lanes));
    let mut tangent = Guarded::zeros(want.tangent.len());
    let batch = pf_bending_batch {
        size: size_of::<pf_bending_batch>() as u64,
        lanes: lanes as u32,
        reserved: 0,
        dt: DT,
        metric: c.pointer(),
        curvature: k.pointer(),
        history: now.pointer(),
        moment: moment.pointer(),
        energy: energy.pointer(),
        tangent: if ask.bound {
            tangent.pointer()
        } else {
            std::ptr::null_mut()
        },
    };
    (0..CALLS)
        .filter(|_| {
            now.slice_mut().copy_from_slice(history.slice());
            // SAFETY: as in the call above, with buffers of this thread's own.
            let code = counter.during(|| unsafe { bending(law.instance(), &raw const batch) });
            let outputs = [
                (&moment, &want.moment[..]),
                (&energy, &want.energy),
                (&tangent, &want.tangent),
                (&now, after.slice()),
            ];
            code != PF_OK || outputs.iter().any(|(got, want)| !same(got.slice(), want))
        })
        .count()
}

fn threads(law: &Law) -> Seen {
    let start = |thread: usize| {
        let seed = 201 + 2 * thread as u64;
        let (m, k) = (metrics(LANES, 0.02, seed), curvatures(LANES, GENTLE, seed));
        let history = bend(law, &m, &k, Ask::NOTHING).0;
        (history, m, k)
    };
    let alone = |(history, m, k): &(Guarded, Vec<f64>, Vec<f64>), ask| {
        let mut after = history.clone();
        let answer = call(law, &mut after, m, k, ask);
        (after, answer)
    };
    meeting::judge(start, alone, |(history, m, k), ask, want, counter| {
        hammer(law, (history, m, k), ask, want, counter)
    })
}

/// As of the membrane: in 2000 steps to and fro, gently and sharply.
fn cycle(law: &Law) -> Seen {
    let mut cycles = Cycles::default();
    let m = metrics(LANES, 0.02, 107);
    for largest in [GENTLE, sharp(law)] {
        let (a, b) = (
            curvatures(LANES, largest, 109),
            curvatures(LANES, largest, 127),
        );
        let mut history = start(law, LANES);
        let at = |t: f64| {
            let (s, c) = t.fixed_sin_cos();
            let bent = a.iter().zip(&b);
            bent.map(|(a, b)| s * a + (1.0 - c) * 0.5 * b).collect()
        };
        cycles.lead(LANES, [1.0, 1.0, 2.0], at, |k: &[f64]| {
            let a = call(law, &mut history, &m, k, Ask::NOTHING);
            (a.moment, a.energy)
        });
    }
    cycles.seen(&format!("curvatures to {:.0} 1/m", sharp(law)))
}

fn rest(law: &Law) -> Seen {
    let m = metrics(LANES, 0.02, 107);
    let a = call(
        law,
        &mut start(law, LANES),
        &m,
        &curvatures(LANES, GENTLE, 109),
        Ask::NOTHING,
    );
    let flat = call(
        law,
        &mut start(law, LANES),
        &m,
        &[0.0; 3 * LANES],
        Ask::NOTHING,
    );
    let (x, w) = (
        size(&flat.moment) / largest(&a.moment),
        size(&flat.energy) / largest(&a.energy),
    );
    Seen::Number {
        measured: x.max(w),
        limit: 1e-9,
        what: format!("moment when flat {x:.1e} of that at 50 1/m, energy {w:.1e}"),
    }
}

/// The answer at curvatures of this size, and for each component those at curvatures moved by `widths`, forwards and back,
/// from copies of the history.
struct Sides {
    answer: Answer,
    widths: [f64; 3],
    sides: Vec<[[Answer; 3]; 2]>,
}

fn either_side(law: &Law, largest: f64) -> Sides {
    let widths = [1e-5, 3e-5, 1e-4].map(|part| part * largest);
    let (m, k) = (metrics(LANES, 0.02, 107), curvatures(LANES, largest, 109));
    let mut history = start(law, LANES);
    let mut answer = call(law, &mut history, &m, &[0.0; 3 * LANES], Ask::EVERYTHING);
    for i in 1..=STEPS {
        let part = i as f64 / STEPS as f64;
        let now: Vec<f64> = k.iter().map(|k| part * k).collect();
        answer = call(law, &mut history, &m, &now, Ask::EVERYTHING);
    }
    let moved = |row: usize, by: f64| {
        let mut k = k.clone();
        for x in &mut k[row * LANES..(row + 1) * LANES] {
            *x += by;
        }
        call(law, &mut history.clone(), &m, &k, Ask::NOTHING)
    };
    let sides = (0..3)
        .map(|row| [1.0, -1.0].map(|sign| widths.map(|h| moved(row, sign * h))))
        .collect();
    Sides {
        answer,
        widths,
        sides,
    }
}

/// The largest difference of what the law gives (`of` its answer) from what it should, over the component's largest, at
/// gentle and sharp curvatures. `wanted`: of a component and a lane and of what was given there; `told` makes the text.
fn worst(
    law: &Law,
    of: impl Fn(&Answer) -> &[f64],
    wanted: impl Fn(&Sides, usize, usize, f64) -> f64,
    told: impl Fn(usize, f64, f64) -> String,
) -> Seen {
    let mut worst = (0.0, String::new());
    for largest_curvature in [GENTLE, sharp(law)] {
        let s = either_side(law, largest_curvature);
        let given = of(&s.answer);
        for row in 0..3 {
            let own = largest(&given[row * LANES..(row + 1) * LANES]);
            let scale = own.max(1e-9 * largest(given));
            for l in 0..LANES {
                let got = given[row * LANES + l];
                let want = wanted(&s, row, l, got);
                let error = (got - want).abs() / scale;
                if worse(error, worst.0) {
                    worst = (error, told(row, got, want));
                }
            }
        }
    }
    Seen::Number {
        measured: worst.0,
        limit: 1e-4,
        what: format!(
            "off by {:.1e} of the component's largest (curvatures to {:.0} 1/m); {}",
            worst.0,
            sharp(law),
            worst.1
        ),
    }
}

fn moment(law: &Law) -> Seen {
    let seen = worst(
        law,
        |a| &a.moment,
        |s, row, l, got| {
            let energies = |side: &[Answer; 3]| [0, 1, 2].map(|i| side[i].energy[l]);
            let [up, down] = &s.sides[row];
            let energies = Energies {
                widths: s.widths,
                at: s.answer.energy[l],
                up: energies(up),
                down: energies(down),
            };
            energies.nearest(if row == 2 { 0.5 } else { 1.0 }, got)
        },
        |row, got, want| {
            let name = ["M11", "M22", "M12"][row];
            format!("{name} is {got:.6e} N, the energy's derivative {want:.6e} N")
        },
    );
    let k = curvatures(LANES, GENTLE, 109);
    let [a, sheared] = [(0.02, 107), (0.1, 113)]
        .map(|(strain, seed)| bend(law, &metrics(LANES, strain, seed), &k, Ask::NOTHING).1);
    let differ = (0..3 * LANES).fold(0.0f64, |d, i| {
        d.max((sheared.moment[i] - a.moment[i]).abs())
    }) / largest(&a.moment);
    match seen {
        Seen::Number {
            measured,
            limit,
            what,
        } if differ > 1e-9 => Seen::Number {
            measured,
            limit,
            what: format!(
                "{what}; moments depend on the metric ({differ:.1e}): with rf4 the ledger will not close"
            ),
        },
        other => other,
    }
}

fn tangent(law: &Law) -> Seen {
    // Where something slips or fails, each side has a tangent of its own, and either is right.
    let remembers = law.sizes.bending_history > 0;
    worst(
        law,
        |a| &a.tangent,
        |s, row, l, got| {
            let (i, h) = (row * LANES + l, s.widths[0]);
            let [up, down] = [0, 1].map(|side| s.sides[row][side][0].moment[i]);
            let central = (up - down) / (2.0 * h);
            if !remembers {
                return central;
            }
            let at = s.answer.moment[i];
            let sides = [(up - at) / h, (at - down) / h];
            let off = |x: f64| (got - x).abs();
            let nearer = |a, b| if off(b) < off(a) { b } else { a };
            sides.into_iter().fold(central, nearer)
        },
        |row, got, want| format!("component {row}: {got:.6e} N m, dM/dk is {want:.6e} N m"),
    )
}
