//! Checks of an element's mechanics: rest, mass, balance, frame, energy, work, critical step.

use crate::breaches::{Ask, Breaches};
use crate::linear::{Vec3, cross};
use crate::linear::{largest_eigenvalue, rotation};
use crate::rules;
use crate::run::{Run, Seen, worse};
use crate::sequence::Sequence;
use crate::shapes::{Elements, moved};
use crate::subject::{Answer, Masses, Motion, STRAIN, State, Subject};
use plyflow_fixed::FixedBits;

pub(crate) fn judge(run: &mut Run<'_>, subject: &Subject, lanes: usize) {
    let elements = Elements::new(subject.nodes(), lanes, 31);
    let case = Case::new(subject, &elements);
    run.check(rules::REST, || case.rest());
    run.check(rules::MASS, || case.mass());
    run.check(rules::BALANCE, || case.balance());
    run.check(rules::FRAME, || case.frame());
    run.check(rules::ENERGY, || case.energy());
    run.check(rules::WORK, || case.work());
    run.check(rules::STEP, || case.critical_step());
}

struct Case<'a> {
    subject: &'a Subject,
    elements: &'a Elements,
    lanes: usize,
    masses: Masses,
    /// After rest and a deformation by [`STRAIN`] in steps.
    state: State,
    position: Vec<f64>,
    answer: Answer,
}

/// Steps in which the deformed state is reached: laws that turn with the spin want small ones.
const STEPS: usize = 20;

/// Between two positions.
fn between(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect()
}

impl<'a> Case<'a> {
    fn new(subject: &'a Subject, elements: &'a Elements) -> Self {
        let (mut state, masses) = subject.initialise(elements);
        let position = elements.deformed(STRAIN, 37);
        let still = Rigid {
            q: rotation([0.0; 3]),
            shift: [0.0; 3],
            steps: 0,
        };
        let answer = path(subject, &mut state, elements, &position, &still);
        Self {
            subject,
            elements,
            lanes: elements.lanes,
            masses,
            state,
            position,
            answer,
        }
    }

    fn lane_of(&self, i: usize) -> usize {
        i % self.lanes
    }

    /// The largest of `|a - b|` over the largest force of the lane; rows of vectors.
    fn difference(&self, a: &[f64], b: &[f64], scale: impl Fn(usize) -> f64) -> (f64, usize) {
        let mut worst = (0.0, 0);
        for i in 0..a.len() {
            let l = self.lane_of(i);
            let error = (a[i] - b[i]).abs() / scale(l);
            if worse(error, worst.0) {
                worst = (error, l);
            }
        }
        worst
    }

    fn force_scale(&self, l: usize) -> f64 {
        self.answer.largest(l).max(f64::MIN_POSITIVE)
    }

    /// A thin sheet's moments are a thousandth of its membrane forces times its size: they have a scale of
    /// their own where there are any.
    fn moment_scale(&self, l: usize) -> f64 {
        let lever = self.force_scale(l) * self.elements.size[l];
        if !self.subject.rotates() {
            return lever;
        }
        let rows = self.answer.moment.chunks_exact(self.lanes);
        let own = rows.fold(0.0f64, |m, row| m.max(row[l].abs()));
        own.max(1e-7 * lever)
    }

    fn rest(&self) -> Seen {
        let (mut state, _) = self.subject.initialise(self.elements);
        let x = &self.elements.reference;
        let rest = self
            .subject
            .forces(&mut state, x, Motion::default(), Ask::NOTHING);
        let zero = vec![0.0; rest.force.len()];
        let (force, lane) = self.difference(&rest.force, &zero, |l| self.force_scale(l));
        let (moment, _) = self.difference(&rest.moment, &zero, |l| self.moment_scale(l));
        let energy = (0..self.lanes).fold(0.0f64, |m, l| {
            m.max(rest.total(l).abs() / self.answer.total(l).abs().max(f64::MIN_POSITIVE))
        });
        Seen::Number {
            measured: force.max(moment).max(energy),
            limit: 1e-8,
            what: format!(
                "force at rest {force:.1e} of that at 2 % strain (lane {lane}), energy {energy:.1e}"
            ),
        }
    }

    fn mass(&self) -> Seen {
        let areal = self.subject.of_material.areal_mass;
        let n = self.lanes;
        let (m, j) = (&self.masses.mass, &self.masses.inertia);
        if let Some(i) = m.iter().position(|m| *m <= 0.0) {
            return Seen::Bad(format!("node {}, lane {}: mass {} kg", i / n, i % n, m[i]));
        }
        if let Some(i) = j.iter().position(|j| *j <= 0.0) {
            let text = format!("node {}, lane {}: inertia {} kg m2", i / n, i % n, j[i]);
            return Seen::Bad(text);
        }
        let mut worst = (0.0, 0, 0.0);
        for l in 0..n {
            let sum: f64 = m.chunks_exact(n).map(|row| row[l]).sum();
            let error = (sum / (areal * self.elements.area(l)) - 1.0).abs();
            if error > worst.0 {
                worst = (error, l, sum);
            }
        }
        Seen::Number {
            measured: worst.0,
            limit: 1e-6,
            what: format!(
                "nodal masses over {areal} kg/m2 times the area differ from 1 by {:.1e} (lane {})",
                worst.0, worst.1
            ),
        }
    }

    fn balance(&self) -> Seen {
        let (mut worst, mut turning) = (0.0f64, 0.0f64);
        let a = &self.answer;
        for l in 0..self.lanes {
            let (mut sum, mut moment) = ([0.0; 3], [0.0; 3]);
            for k in 0..self.subject.nodes() {
                let f = self.elements.node(&a.force, k, l);
                let x = self.elements.node(&self.position, k, l);
                let own = if self.subject.rotates() {
                    self.elements.node(&a.moment, k, l)
                } else {
                    [0.0; 3]
                };
                let about = cross(x, f);
                for c in 0..3 {
                    sum[c] += f[c];
                    moment[c] += about[c] + own[c];
                }
            }
            for c in 0..3 {
                worst = worst.max(sum[c].abs() / self.force_scale(l));
                turning = turning.max(moment[c].abs() / self.moment_scale(l));
            }
        }
        let scale = if self.subject.rotates() {
            "the largest moment"
        } else {
            "force times size"
        };
        Seen::Number {
            measured: worst.max(turning),
            limit: 1e-7,
            what: format!(
                "sum of forces {worst:.1e} of the largest, of moments {turning:.1e} of {scale}"
            ),
        }
    }

    fn frame(&self) -> Seen {
        let q = rotation([0.62, 1.23, 1.84]);
        let (mut state, _) = self.subject.initialise(self.elements);
        let motion = Rigid {
            q,
            shift: [0.07, -0.13, 0.04],
            // Spins are added up by whoever follows them: many small ones.
            steps: if self.subject.rotates() { 4000 } else { 1 },
        };
        let turned = path(
            self.subject,
            &mut state,
            self.elements,
            &self.position,
            &motion,
        );
        if let Some(text) = turned.breaches.any() {
            return Seen::Bad(text);
        }
        let a = &self.answer;
        let want = moved(&a.force, self.lanes, &q, [0.0; 3]);
        let (force, lane) = self.difference(&turned.force, &want, |l| self.force_scale(l));
        let want = moved(&a.moment, self.lanes, &q, [0.0; 3]);
        let (moment, _) = self.difference(&turned.moment, &want, |l| self.moment_scale(l));
        let energy = (0..self.lanes).fold(0.0f64, |m, l| {
            let w = a.total(l);
            m.max((turned.total(l) - w).abs() / w.abs().max(f64::MIN_POSITIVE))
        });
        let (limit, how) = if self.subject.rotates() {
            (1e-4, "4000 steps of 0.03 degrees")
        } else {
            (1e-7, "at once")
        };
        Seen::Number {
            measured: force.max(moment).max(energy),
            limit,
            what: format!(
                "turned by 132 degrees ({how}): forces off by {force:.1e} of the largest (lane {lane}), \
                 moments by {moment:.1e}, energy by {energy:.1e}"
            ),
        }
    }

    /// Central differences of what `of` reads from the answer, by coordinate `row` (after the translations come
    /// the rotations): for every lane the change over the step.
    fn slope(
        &self,
        state: &State,
        position: &[f64],
        row: usize,
        step: impl Fn(usize) -> f64,
        of: &mut dyn FnMut(&Answer, f64),
    ) {
        let (n, vectors) = (self.lanes, position.len());
        let rows = vectors / n;
        for sign in [1.0, -1.0] {
            let mut copy = state.clone();
            let mut x = position.to_vec();
            let mut spin = vec![0.0; vectors];
            for l in 0..n {
                if row < rows {
                    x[row * n + l] += sign * step(l);
                } else {
                    spin[(row - rows) * n + l] = sign * step(l) / self.elements.size[l];
                }
            }
            let motion = Motion {
                from: Some(position),
                spin: Some(&spin),
            };
            of(
                &self.subject.forces(&mut copy, &x, motion, Ask::NOTHING),
                sign,
            );
        }
    }

    /// Rows of degrees of freedom: translations, then rotations.
    fn rows(&self) -> usize {
        3 * self.subject.nodes() * if self.subject.rotates() { 2 } else { 1 }
    }

    /// For every lane the derivative of its energy by coordinate `row`, with steps of `part` of its size.
    fn derivative(&self, row: usize, part: f64) -> Vec<f64> {
        let h = |l: usize| part * self.elements.size[l];
        let mut slope = vec![0.0; self.lanes];
        self.slope(&self.state, &self.position, row, h, &mut |a, sign| {
            for (l, s) in slope.iter_mut().enumerate() {
                *s += sign * a.total(l) / (2.0 * h(l));
            }
        });
        slope
    }

    fn energy(&self) -> Seen {
        let n = self.lanes;
        let translations = 3 * self.subject.nodes();
        let mut worst = (0.0, String::new());
        for row in 0..self.rows() {
            // The noise of an energy over a small step is an error of its derivative, and a large step may reach
            // over a kink: a right force is right by one of them.
            let slopes = [1e-6, 1e-4].map(|part| self.derivative(row, part));
            for l in 0..n {
                let (got, lever, scale, name) = if row < translations {
                    let got = self.answer.force[row * n + l];
                    (got, 1.0, self.force_scale(l), "force (N)")
                } else {
                    // The step of a rotation is that of a translation over the size.
                    let got = self.answer.moment[(row - translations) * n + l];
                    let size = self.elements.size[l];
                    (got, size, self.moment_scale(l), "moment (N m)")
                };
                let [small, large] = [slopes[0][l] * lever, slopes[1][l] * lever];
                let nearer = (got - small).abs() <= (got - large).abs();
                let want = if nearer { small } else { large };
                let error = (got - want).abs() / scale;
                if worse(error, worst.0) {
                    let at = row % translations;
                    worst.0 = error;
                    worst.1 = format!(
                        "node {}, axis {}, lane {l}: {name} {got:.6e}, derivative of the energy {want:.6e}",
                        at / 3,
                        at % 3
                    );
                }
            }
        }
        // A law with history may have its kinks inside the step.
        let limit = if self.subject.remembers() { 1e-4 } else { 1e-5 };
        Seen::Number {
            measured: worst.0,
            limit,
            what: format!("off by {:.1e} of the largest; {}", worst.0, worst.1),
        }
    }

    fn work(&self) -> Seen {
        if !self.subject.remembers() {
            let why = "forces depend on the position alone: the check `energy` says it all";
            return Seen::Nothing(why.into());
        }
        const N: usize = 400;
        let n = self.lanes;
        let (mut state, _) = self.subject.initialise(self.elements);
        let x0 = &self.elements.reference;
        let (a, b) = (
            self.elements.deformed(STRAIN, 41),
            self.elements.deformed(STRAIN, 43),
        );
        let at = |t: f64| -> Vec<f64> {
            let (s, c) = ((6.0 * t).fixed_sin(), 1.0 - (4.0 * t).fixed_cos());
            (0..x0.len())
                .map(|i| x0[i] + s * (a[i] - x0[i]) + c * (b[i] - x0[i]))
                .collect()
        };
        let mut before = x0.clone();
        let mut old = self
            .subject
            .forces(&mut state, x0, Motion::default(), Ask::NOTHING);
        let start: Vec<f64> = (0..n).map(|l| old.total(l)).collect();
        let (mut work, mut error, mut size) = (vec![0.0; n], vec![0.0f64; n], vec![0.0f64; n]);
        for i in 1..=N {
            let x = at(i as f64 / N as f64);
            let motion = Motion {
                from: Some(&before),
                spin: None,
            };
            let new = self.subject.forces(&mut state, &x, motion, Ask::NOTHING);
            for j in 0..x.len() {
                work[j % n] += 0.5 * (old.force[j] + new.force[j]) * (x[j] - before[j]);
            }
            for l in 0..n {
                let change = new.total(l) - start[l];
                error[l] = error[l].max((work[l] - change).abs());
                size[l] = size[l].max(change.abs());
            }
            (before, old) = (x, new);
        }
        let worst = (0..n)
            .map(|l| (error[l] / size[l].max(f64::MIN_POSITIVE), l))
            .fold((0.0, 0), |m, e| if e.0 <= m.0 { m } else { e });
        Seen::Number {
            measured: worst.0,
            limit: 2e-3,
            what: format!(
                "along a winding path of {N} steps, work and energy differ by {:.1e} of the largest \
                 energy (lane {})",
                worst.0, worst.1
            ),
        }
    }

    fn critical_step(&self) -> Seen {
        let (mut largest, mut smallest) = ((0.0f64, 0, ""), f64::INFINITY);
        for (strain, name) in [(0.0, "at rest"), (STRAIN, "at 2 %"), (0.1, "at 10 %")] {
            let (state, _, answer) = self.subject.once(self.elements, strain, Ask::EVERYTHING);
            let x = self.elements.deformed(strain, 7);
            for (l, eigenvalue) in self.eigenvalues(&state, &x).into_iter().enumerate() {
                let step = answer.step[l];
                if step <= 0.0 {
                    return Seen::Bad(format!("critical step {step} s {name}, lane {l}"));
                }
                let ratio = step / (2.0 / eigenvalue.max(f64::MIN_POSITIVE).sqrt());
                if ratio > largest.0 {
                    largest = (ratio, l, name);
                }
                smallest = smallest.min(ratio);
            }
        }
        Seen::Number {
            measured: largest.0,
            limit: 1.0 + 1e-4,
            what: format!(
                "{smallest:.2} to {:.2} of the true 2 / omega_max, over {} elements (largest: {}, lane {})",
                largest.0, self.lanes, largest.2, largest.1
            ),
        }
    }

    /// Largest eigenvalue of M^-1/2 K M^-1/2 in every lane (1/s2), K by central differences of the forces.
    fn eigenvalues(&self, state: &State, position: &[f64]) -> Vec<f64> {
        let (n, rows) = (self.lanes, self.rows());
        let translations = 3 * self.subject.nodes();
        let h = |l: usize| 1e-6 * self.elements.size[l];
        let mut stiffness = vec![vec![0.0; rows * rows]; n];
        // Rotations are scaled by the element's size, so that all rows are lengths and forces.
        let inertia = |row: usize, l: usize| {
            let node = (row % translations) / 3;
            if row < translations {
                self.masses.mass[node * n + l]
            } else {
                self.masses.inertia[node * n + l] / self.elements.size[l].powi(2)
            }
        };
        for column in 0..rows {
            self.slope(state, position, column, h, &mut |a, sign| {
                for (l, k) in stiffness.iter_mut().enumerate() {
                    for row in 0..rows {
                        let force = if row < translations {
                            a.force[row * n + l]
                        } else {
                            a.moment[(row - translations) * n + l] / self.elements.size[l]
                        };
                        let weight = (inertia(row, l) * inertia(column, l)).sqrt();
                        k[row * rows + column] += sign * force / (2.0 * h(l) * weight);
                    }
                }
            });
        }
        stiffness
            .iter()
            .map(|k| largest_eigenvalue(k, rows))
            .collect()
    }
}

/// Rotation vectors of the nodes in a step, of about `angle`; the same in every call.
fn spins(elements: &Elements, angle: f64) -> Vec<f64> {
    let mut s = Sequence(47);
    (0..elements.reference.len())
        .map(|_| angle * s.next())
        .collect()
}

/// A rigid motion: a rotation `q` and a shift (m). Positions move without a jump only in more than one step; none: at once.
struct Rigid {
    q: [Vec3; 3],
    shift: Vec3,
    steps: usize,
}

/// From rest: a rigid motion, then in [`STEPS`] steps to `position`, seen from there, with a spin of each node.
fn path(
    subject: &Subject,
    state: &mut State,
    elements: &Elements,
    position: &[f64],
    rigid: &Rigid,
) -> Answer {
    let (q, shift, turning) = (&rigid.q, rigid.shift, rigid.steps);
    let lanes = elements.lanes;
    let reference = &elements.reference;
    let mut breaches = Breaches::default();
    let mut before = reference.clone();
    let mut answer = subject.forces(state, reference, Motion::default(), Ask::NOTHING);
    let axis = axis_of(q);
    for i in 1..=turning {
        let part = i as f64 / turning as f64;
        let now = rotation(axis.map(|a| a * part));
        let x = moved(reference, lanes, &now, shift.map(|s| s * part));
        let step: Vec<f64> = (0..x.len())
            .map(|j| axis[(j / lanes) % 3] / turning as f64)
            .collect();
        let motion = Motion {
            from: Some(&before),
            spin: Some(&step),
        };
        answer = subject.forces(state, &x, motion, Ask::NOTHING);
        breaches.add(std::mem::take(&mut answer.breaches));
        before = x;
    }
    let spin = spins(elements, 0.5 * STRAIN / STEPS as f64);
    let spin = moved(&spin, lanes, q, [0.0; 3]);
    for i in 1..=STEPS {
        let flat = between(reference, position, i as f64 / STEPS as f64);
        let x = moved(&flat, lanes, q, shift);
        let motion = Motion {
            from: Some(&before),
            spin: Some(&spin),
        };
        answer = subject.forces(state, &x, motion, Ask::NOTHING);
        breaches.add(std::mem::take(&mut answer.breaches));
        before = x;
    }
    answer.breaches = breaches;
    answer
}

/// The rotation vector of a rotation by less than 180 degrees.
fn axis_of(q: &[Vec3; 3]) -> Vec3 {
    let cosine = 0.5 * (q[0][0] + q[1][1] + q[2][2] - 1.0);
    let angle = cosine.clamp(-1.0, 1.0).fixed_acos();
    let twice = [q[2][1] - q[1][2], q[0][2] - q[2][0], q[1][0] - q[0][1]];
    let length = twice.iter().map(|x| x * x).sum::<f64>().sqrt();
    twice.map(|x| x * angle / length.max(f64::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_of_a_rotation_is_its_rotation_vector() {
        let w = [0.62, 1.23, 1.84];
        let back = axis_of(&rotation(w));
        assert!((0..3).all(|i| (w[i] - back[i]).abs() < 1e-12));
    }
}
