//! Checks of an element's patch part.

use crate::breaches::{Ask, Breaches, DT};
use crate::linear::{Vec3, cross};
use crate::linear::{norm, rotation};
use crate::meeting;
use crate::neighbours::{self, mixed, of_lanes};
use crate::rules;
use crate::run::{Run, Seen, worse};
use crate::shapes::{Patches, moved};
use crate::subject::Subject;
use crate::subject::patch::{PatchAnswer, PatchState};
use crate::tapes;

const LANES: usize = 16;

pub(crate) fn judge(run: &mut Run<'_>, subject: &Subject, twin: &Subject) {
    if subject.slots() == 0 {
        return;
    }
    let set = |lanes, seed| Patches::new(subject.nodes(), subject.slots(), lanes, seed);
    let Some(patches) = set(LANES, 51) else {
        run.check(rules::PATCH_COMPLETE, || {
            Seen::Bad(format!(
                "{} patch nodes: not even the smallest patch, three elements around a node, fits",
                subject.slots()
            ))
        });
        return;
    };
    let mut all = Breaches::default();
    let zones = run.check(rules::PATCH_GUARDS, || {
        for lanes in [8, 24, 64] {
            let Some(patches) = set(lanes, 53) else { break };
            for ask in Ask::ALL {
                let (_, answer) = bend(subject, &patches, ask);
                all.add(answer.breaches);
            }
        }
        match all.guards.take() {
            Some(text) => Seen::Bad(text),
            None => Seen::Well("batches of 8 to 64 patches of 3 to 5 elements".into()),
        }
    });
    let whole = run.check(rules::PATCH_COMPLETE, || match all.any() {
        Some(text) => Seen::Bad(text),
        None => unused(subject, &patches),
    });
    if !(zones && whole) {
        run.skip(&rules::OF_PATCHES, "not checked: repair the above first");
        return;
    }
    run.check(rules::PATCH_REPEATABLE, || {
        repeatable(subject, twin, &patches)
    });
    run.check(rules::PATCH_LANES, || lanes(subject));
    run.check(rules::PATCH_ASKING, || asking(subject, &patches));
    run.check(rules::PATCH_THREADS, || threads(subject));
    run.check(rules::PATCH_TAPE, || tapes::patch_forces(subject));
    let case = Case::new(subject, &patches);
    run.check(rules::PATCH_REST, || case.rest());
    run.check(rules::PATCH_BALANCE, || case.balance());
    run.check(rules::PATCH_FRAME, || case.frame());
    run.check(rules::PATCH_ENERGY, || case.energy());
    run.check(rules::PATCH_STIFFNESS, || case.stiffness());
}

fn bend(subject: &Subject, patches: &Patches, ask: Ask) -> (PatchState, PatchAnswer) {
    let (mut state, mut breaches) = subject.patch_initialise(patches);
    let flat = subject.patch_forces(&mut state, &patches.reference, 0.0, ask);
    let mut answer = subject.patch_forces(&mut state, &patches.bent(57), DT, ask);
    breaches.add(flat.breaches);
    breaches.add(std::mem::take(&mut answer.breaches));
    answer.breaches = breaches;
    (state, answer)
}

/// Unused slots carry no force.
fn unused(subject: &Subject, patches: &Patches) -> Seen {
    let (_, a) = bend(subject, patches, Ask::NOTHING);
    let n = patches.lanes;
    for l in 0..n {
        for row in 3 * patches.count[l] as usize..3 * subject.slots() {
            if a.force[row * n + l] != 0.0 {
                return Seen::Bad(format!(
                    "slot {} of a patch of {} nodes has a force of {} N",
                    row / 3,
                    patches.count[l],
                    a.force[row * n + l]
                ));
            }
        }
    }
    Seen::Well("all outputs are written and finite; unused slots have no force".into())
}

fn bits(state: &PatchState, a: &PatchAnswer, l: usize) -> Vec<u64> {
    let rows = [
        state.constants.slice(),
        state.history.slice(),
        &a.force,
        &a.energy,
        &a.fields,
        &a.stiffness,
    ];
    rows.into_iter()
        .flat_map(|r| r.chunks_exact(state.lanes).map(|row| row[l].to_bits()))
        .collect()
}

fn lanes(subject: &Subject) -> Seen {
    let Some(all) = Patches::new(subject.nodes(), subject.slots(), neighbours::ALL, 59) else {
        return Seen::Nothing("no patch fits".into());
    };
    let part = |share: f64| -> Vec<f64> {
        let bent = all.bent(57);
        let flat = all.reference.iter();
        flat.zip(&bent).map(|(a, b)| a + share * (b - a)).collect()
    };
    let bent = mixed(&[part(1.0), part(1e-2), part(1e-9)]);
    neighbours::judge(|order| {
        let patches = all.picked(order);
        let (mut state, _) = subject.patch_initialise(&patches);
        let x = of_lanes(&bent, order);
        let a = subject.patch_forces(&mut state, &x, DT, Ask::EVERYTHING);
        (0..order.len()).map(|l| bits(&state, &a, l)).collect()
    })
}

fn repeatable(subject: &Subject, twin: &Subject, patches: &Patches) -> Seen {
    let first = bend(subject, patches, Ask::EVERYTHING);
    for (which, again) in [("the same", subject), ("another", twin)] {
        let second = bend(again, patches, Ask::EVERYTHING);
        let differs = |l: &usize| bits(&first.0, &first.1, *l) != bits(&second.0, &second.1, *l);
        if let Some(l) = (0..LANES).find(differs) {
            return Seen::Bad(format!(
                "lane {l} differs in a second call of {which} instance"
            ));
        }
    }
    Seen::Well("same bits in a second call and in a second instance".into())
}

fn asking(subject: &Subject, patches: &Patches) -> Seen {
    let all = bend(subject, patches, Ask::EVERYTHING);
    for ask in Ask::ALL {
        let some = bend(subject, patches, ask);
        let mut want = all.1.clone();
        if !ask.fields {
            want.fields.clear();
        }
        if !ask.bound {
            want.stiffness.clear();
        }
        let differs = (0..LANES).find(|l| bits(&all.0, &want, *l) != bits(&some.0, &some.1, *l));
        if let Some(l) = differs {
            let told = ask.told("stiffness");
            return Seen::Bad(format!("lane {l}: another answer when {told}"));
        }
    }
    Seen::Well("same bits with and without fields and stiffness, each alone too".into())
}

fn threads(subject: &Subject) -> Seen {
    let set = |t| Patches::new(subject.nodes(), subject.slots(), LANES, 201 + 2 * t as u64);
    if set(0).is_none() {
        return Seen::Nothing("no patch fits".into());
    }
    let start = |thread: usize| {
        let set = set(thread).expect("whether one fits does not depend on the seed");
        (bend(subject, &set, Ask::NOTHING).0, set.bent(57))
    };
    let alone = |(state, x): &(PatchState, Vec<f64>), ask| {
        let mut after = state.clone();
        let answer = subject.patch_forces(&mut after, x, 0.0, ask);
        (after, answer)
    };
    meeting::judge(start, alone, |(state, x), ask, want, counter| {
        subject.hammer_patches((state, x), ask, want, counter)
    })
}

struct Case<'a> {
    subject: &'a Subject,
    patches: &'a Patches,
    state: PatchState,
    position: Vec<f64>,
    answer: PatchAnswer,
}

impl<'a> Case<'a> {
    fn new(subject: &'a Subject, patches: &'a Patches) -> Self {
        let (state, answer) = bend(subject, patches, Ask::EVERYTHING);
        Self {
            subject,
            patches,
            state,
            position: patches.bent(57),
            answer,
        }
    }

    fn scale(&self, l: usize) -> f64 {
        let rows = self.answer.force.chunks_exact(self.patches.lanes);
        let largest = rows.fold(0.0f64, |m, row| m.max(row[l].abs()));
        largest.max(f64::MIN_POSITIVE)
    }

    fn worst(&self, a: &[f64], b: &[f64]) -> (f64, usize) {
        let mut worst = (0.0, 0);
        for i in 0..a.len() {
            let l = i % self.patches.lanes;
            let error = (a[i] - b[i]).abs() / self.scale(l);
            if worse(error, worst.0) {
                worst = (error, l);
            }
        }
        worst
    }

    fn rest(&self) -> Seen {
        let (mut state, _) = self.subject.patch_initialise(self.patches);
        let x = &self.patches.reference;
        let rest = self.subject.patch_forces(&mut state, x, 0.0, Ask::NOTHING);
        let (force, lane) = self.worst(&rest.force, &vec![0.0; rest.force.len()]);
        let energy = rest.energy.iter().zip(&self.answer.energy);
        let energy = energy.fold(0.0f64, |m, (rest, bent)| {
            m.max(rest.abs() / bent.abs().max(f64::MIN_POSITIVE))
        });
        Seen::Number {
            measured: force.max(energy),
            limit: 1e-8,
            what: format!(
                "force at rest {force:.1e} of that of the bent patch (lane {lane}), energy {energy:.1e}"
            ),
        }
    }

    fn balance(&self) -> Seen {
        let n = self.patches.lanes;
        let vector = |x: &[f64], k: usize, l: usize| -> Vec3 {
            std::array::from_fn(|c| x[(3 * k + c) * n + l])
        };
        let (mut worst, mut turning) = (0.0f64, 0.0f64);
        for l in 0..n {
            let (mut sum, mut moment) = ([0.0; 3], [0.0; 3]);
            for k in 0..self.subject.slots() {
                let f = vector(&self.answer.force, k, l);
                let m = cross(vector(&self.position, k, l), f);
                sum = std::array::from_fn(|c| sum[c] + f[c]);
                moment = std::array::from_fn(|c| moment[c] + m[c]);
            }
            let size = self.patches.area[l].sqrt();
            for c in 0..3 {
                worst = worst.max(sum[c].abs() / self.scale(l));
                turning = turning.max(moment[c].abs() / (size * self.scale(l)));
            }
        }
        Seen::Number {
            measured: worst.max(turning),
            limit: 1e-7,
            what: format!(
                "sum of forces {worst:.1e} of the largest, of moments {turning:.1e} of force times size"
            ),
        }
    }

    fn frame(&self) -> Seen {
        let n = self.patches.lanes;
        let q = rotation([0.62, 1.23, 1.84]);
        let (mut state, _) = self.subject.patch_initialise(self.patches);
        let x = moved(&self.position, n, &q, [0.07, -0.13, 0.04]);
        let turned = self.subject.patch_forces(&mut state, &x, DT, Ask::NOTHING);
        let want = moved(&self.answer.force, n, &q, [0.0; 3]);
        let (force, lane) = self.worst(&turned.force, &want);
        Seen::Number {
            measured: force,
            limit: 1e-6,
            what: format!(
                "turned by 132 degrees: forces off by {force:.1e} of the largest (lane {lane})"
            ),
        }
    }

    /// Answers at coordinate `row` moved to and fro by a part of the size, from copies of the state.
    fn either_side(&self, row: usize, part: f64) -> [PatchAnswer; 2] {
        let n = self.patches.lanes;
        [1.0, -1.0].map(|sign| {
            let mut x = self.position.clone();
            for l in 0..n {
                if row < 3 * self.patches.count[l] as usize {
                    x[row * n + l] += sign * part * self.patches.area[l].sqrt();
                }
            }
            let mut state = self.state.clone();
            self.subject.patch_forces(&mut state, &x, DT, Ask::NOTHING)
        })
    }

    fn energy(&self) -> Seen {
        let n = self.patches.lanes;
        let part = 1e-6;
        let mut worst = (0.0, String::new());
        for row in 0..3 * self.subject.slots() {
            let [up, down] = self.either_side(row, part);
            for l in 0..n {
                let h = part * self.patches.area[l].sqrt();
                let want = (up.energy[l] - down.energy[l]) / (2.0 * h);
                let got = self.answer.force[row * n + l];
                let error = (got - want).abs() / self.scale(l);
                if worse(error, worst.0) {
                    let (node, axis) = (row / 3, row % 3);
                    worst = (
                        error,
                        format!(
                            "node {node}, axis {axis}, lane {l}: force {got:.6e} N, derivative {want:.6e} N"
                        ),
                    );
                }
            }
        }
        Seen::Number {
            measured: worst.0,
            limit: 1e-4,
            what: format!("off by {:.1e} of the largest force; {}", worst.0, worst.1),
        }
    }

    fn stiffness(&self) -> Seen {
        let (n, slots) = (self.patches.lanes, self.subject.slots());
        let part = 1e-6;
        let rows = 3 * slots;
        let mut hessian = vec![vec![0.0; rows * rows]; n];
        for column in 0..rows {
            let [up, down] = self.either_side(column, part);
            for (l, k) in hessian.iter_mut().enumerate() {
                let h = part * self.patches.area[l].sqrt();
                for row in 0..rows {
                    let change = up.force[row * n + l] - down.force[row * n + l];
                    k[row * rows + column] = change / (2.0 * h);
                }
            }
        }
        let (mut largest, mut smallest, mut place) = (0.0f64, f64::INFINITY, (0, 0));
        for (l, k) in hessian.iter().enumerate() {
            for i in 0..self.patches.count[l] as usize {
                let sum: f64 = (0..slots)
                    .map(|j| {
                        let block: [Vec3; 3] = std::array::from_fn(|a| {
                            std::array::from_fn(|b| k[(3 * i + a) * rows + 3 * j + b])
                        });
                        norm(&block)
                    })
                    .sum();
                let given = self.answer.stiffness[i * n + l];
                if sum == 0.0 && given == 0.0 {
                    continue;
                }
                let ratio = sum / given.max(f64::MIN_POSITIVE);
                if ratio > largest {
                    (largest, place) = (ratio, (i, l));
                }
                smallest = smallest.min(ratio);
            }
        }
        Seen::Number {
            measured: largest,
            limit: 1.0 + 1e-3,
            what: format!(
                "true row sums are {smallest:.2} to {largest:.2} of the given ones (largest: node {}, lane {})",
                place.0, place.1
            ),
        }
    }
}
