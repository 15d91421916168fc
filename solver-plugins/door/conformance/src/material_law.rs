//! Checks of a material's membrane law: rest, derivatives, cycles, the bound of its tangent.

use crate::breaches::Ask;
use crate::buffer::Guarded;
use crate::cycle::Cycles;
use crate::law::{Answer, LANES, Law, STRAIN, largest, metrics, size, trellis, undeformed};
use crate::linear::largest_eigenpair;

use crate::rules;
use crate::run::{Run, Seen, worse};
use crate::slope::Energies;
use plyflow_fixed::FixedBits;

/// Random strains: their size and seed.
const STRAINS: [(f64, u64); 3] = [(0.005, 73), (STRAIN, 79), (0.1, 83)];
/// How far the law is judged, for the verdicts.
const RANGE: &str = "strains to 10 %, trellis shear to 60 degrees";
/// Steps from rest to a state: laws that integrate want small ones.
const STEPS: usize = 60;

pub(crate) fn judge(run: &mut Run<'_>, law: &Law) {
    run.check(rules::REST, || rest(law));
    let states = states(law);
    run.check(rules::STRESS, || stress(law, &states));
    run.check(rules::CYCLE, || cycle(law));
    run.check(rules::TANGENT, || tangent(law, &states));
}

/// A set of lanes as a path has left them.
struct State {
    metric: Vec<f64>,
    history: Guarded,
    answer: Answer,
}

impl State {
    /// From rest straight to the metrics of `path`, one after the other.
    fn after(law: &Law, path: &[&[f64]]) -> Self {
        let mut at = undeformed(LANES);
        let mut history = law.start(LANES);
        let mut answer = law.membrane(&mut history, &at, Ask::EVERYTHING);
        for to in path {
            let from = at.clone();
            for i in 1..=STEPS {
                let part = i as f64 / STEPS as f64;
                at = between(&from, to, part);
                answer = law.membrane(&mut history, &at, Ask::EVERYTHING);
            }
        }
        Self {
            metric: at,
            history,
            answer,
        }
    }

    /// The answer at another metric, from a copy of the history.
    fn at(&self, law: &Law, metric: &[f64]) -> Answer {
        law.membrane(&mut self.history.clone(), metric, Ask::NOTHING)
    }

    /// Answers with component `row` of the metric moved to and fro by `h`.
    fn either_side(&self, law: &Law, row: usize, h: f64) -> [Answer; 2] {
        [h, -h].map(|by| {
            let mut metric = self.metric.clone();
            for c in &mut metric[row * LANES..(row + 1) * LANES] {
                *c += by;
            }
            self.at(law, &metric)
        })
    }
}

fn between(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect()
}

/// Strained in any way, sheared as a trellis, and part of the way back from there, where what has failed shows.
fn states(law: &Law) -> Vec<State> {
    let mut all: Vec<State> = STRAINS
        .iter()
        .map(|(size, seed)| State::after(law, &[&metrics(LANES, *size, *seed)]))
        .collect();
    let sheared = trellis(LANES);
    let back = between(&undeformed(LANES), &sheared, 0.7);
    all.push(State::after(law, &[&sheared]));
    all.push(State::after(law, &[&sheared, &back]));
    all
}

fn rest(law: &Law) -> Seen {
    let strained = State::after(law, &[&metrics(LANES, STRAIN, 67)]).answer;
    let rest = law.membrane(&mut law.start(LANES), &undeformed(LANES), Ask::NOTHING);
    let (s, w) = (
        size(&rest.stress) / largest(&strained.stress),
        size(&rest.energy) / largest(&strained.energy),
    );
    Seen::Number {
        measured: s.max(w),
        limit: 1e-9,
        what: format!("stress at rest {s:.1e} of that at 2 % strain, energy {w:.1e}"),
    }
}

/// Steps of the metric.
const WIDTHS: [f64; 3] = [1e-6, 1e-5, 1e-4];

fn stress(law: &Law, states: &[State]) -> Seen {
    let mut worst = (0.0, String::new());
    for state in states {
        let a = &state.answer;
        for (row, factor) in [(0, 2.0), (1, 2.0), (2, 1.0)] {
            let sides = WIDTHS.map(|h| state.either_side(law, row, h));
            // Each component by its own size: a fabric's shear stress is a thousandth of its fibre stress.
            let own = largest(&a.stress[row * LANES..(row + 1) * LANES]);
            let scale = own.max(1e-9 * largest(&a.stress));
            for l in 0..LANES {
                let got = a.stress[row * LANES + l];
                let [up, down] = [0, 1].map(|side| [0, 1, 2].map(|i| sides[i][side].energy[l]));
                let energies = Energies {
                    widths: WIDTHS,
                    at: a.energy[l],
                    up,
                    down,
                };
                let want = energies.nearest(factor, got);
                let error = (got - want).abs() / scale;
                if worse(error, worst.0) {
                    let name = ["S11", "S22", "S12"][row];
                    let metric = [0, 1, 2].map(|r| state.metric[r * LANES + l]);
                    worst = (
                        error,
                        format!(
                            "{name} is {got:.6e} N/m, the energy's derivative {want:.6e} N/m at C = {metric:.4?}"
                        ),
                    );
                }
            }
        }
    }
    Seen::Number {
        measured: worst.0,
        limit: 1e-4,
        what: format!(
            "off by {:.1e} of the component's largest ({RANGE}); {}",
            worst.0, worst.1
        ),
    }
}

fn cycle(law: &Law) -> Seen {
    let mut cycles = Cycles::default();
    let one = undeformed(LANES);
    let mut lead = |at: &dyn Fn(f64) -> Vec<f64>| {
        let mut history = law.start(LANES);
        cycles.lead(LANES, [0.5, 0.5, 1.0], at, |metric| {
            let a = law.membrane(&mut history, metric, Ask::NOTHING);
            (a.stress, a.energy)
        });
    };
    for (size, seed) in STRAINS {
        let (a, b) = (metrics(LANES, size, seed), metrics(LANES, size, seed + 100));
        lead(&|t| {
            let (s, c) = t.fixed_sin_cos();
            (0..one.len())
                .map(|i| one[i] + s * (a[i] - one[i]) + (1.0 - c) * 0.5 * (b[i] - one[i]))
                .collect()
        });
    }
    // To the one side, to the other, and back.
    let sheared = trellis(LANES);
    lead(&|t| between(&one, &sheared, t.fixed_sin()));
    cycles.seen(RANGE)
}

/// Steps of the strain in the tensor's own norm.
const STEP: f64 = 1e-6;
const ROOT: f64 = std::f64::consts::SQRT_2;

/// Stress as a vector in whose products shear counts twice.
fn vector(stress: &[f64], l: usize) -> [f64; 3] {
    [stress[l], stress[LANES + l], ROOT * stress[2 * LANES + l]]
}

/// For every lane the slope of the stress along its direction, over a step of the strain that way: E11, E22 and
/// root 2 E12 = C12 / root 2.
fn slopes(law: &Law, state: &State, directions: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut metric = state.metric.clone();
    for (l, d) in directions.iter().enumerate() {
        for (row, factor) in [(0, 2.0), (1, 2.0), (2, ROOT)] {
            metric[row * LANES + l] += factor * STEP * d[row];
        }
    }
    let there = state.at(law, &metric);
    (0..LANES)
        .map(|l| {
            let (to, from) = (vector(&there.stress, l), vector(&state.answer.stress, l));
            std::array::from_fn(|i| (to[i] - from[i]) / STEP)
        })
        .collect()
}

/// The steepest slope of the stress in every lane: the largest of d . dS(d) over directions d of the strain.
///
/// To either side on its own: on the path where something fails for good, each side has a tangent of its own, and the
/// mean of both is that of no motion. So differences only say where to look (the eigenvectors of the tangents that they
/// make, in any combination of sides); what counts is the slope that is then measured there.
fn steepest(law: &Law, state: &State) -> Vec<f64> {
    let sides = [1.0, -1.0].map(|sign| {
        [0, 1, 2].map(|axis| {
            let mut d = [0.0; 3];
            d[axis] = sign;
            let rows = slopes(law, state, &[d; LANES]);
            // Towards -d the stress changes by -dS.
            rows.into_iter()
                .map(|s| s.map(|x| sign * x))
                .collect::<Vec<_>>()
        })
    });
    let mut steepest = vec![f64::NEG_INFINITY; LANES];
    for choice in 0..8 {
        let directions: Vec<[f64; 3]> = (0..LANES)
            .map(|l| {
                let mut matrix = [0.0; 9];
                for axis in 0..3 {
                    let column = sides[(choice >> axis) & 1][axis][l];
                    for row in 0..3 {
                        matrix[3 * row + axis] = column[row];
                    }
                }
                let v = largest_eigenpair(&matrix, 3).1;
                [v[0], v[1], v[2]]
            })
            .collect();
        for sign in [1.0, -1.0] {
            let turned: Vec<[f64; 3]> = directions.iter().map(|d| d.map(|x| sign * x)).collect();
            let found = slopes(law, state, &turned);
            for l in 0..LANES {
                let along: f64 = (0..3).map(|i| turned[l][i] * found[l][i]).sum();
                if worse(along, steepest[l]) {
                    steepest[l] = along;
                }
            }
        }
    }
    steepest
}

/// dS12 / d(2 E12) = dS12 / dC12 to the steeper side, in every lane.
fn shear_tangents(law: &Law, state: &State) -> Vec<f64> {
    let [up, down] = state.either_side(law, 2, STEP);
    (0..LANES)
        .map(|l| {
            let [at, up, down] = [&state.answer, &up, &down].map(|a| a.stress[2 * LANES + l]);
            let (forward, backward) = ((up - at) / STEP, (at - down) / STEP);
            if worse(forward, backward) {
                forward
            } else {
                backward
            }
        })
        .collect()
}

fn tangent(law: &Law, states: &[State]) -> Seen {
    let (mut worst, mut least, mut soft) = (0.0f64, f64::INFINITY, 0.0f64);
    let mut place = String::new();
    for state in states {
        let (steepest, shear) = (steepest(law, state), shear_tangents(law, state));
        for l in 0..LANES {
            let given = [0, LANES].map(|r| state.answer.stiffness[r + l]);
            // A sheet that has no stiffness in shear may say so.
            let slack = given[1] == 0.0 && shear[l] <= 0.0;
            if given[0] <= 0.0 || (given[1] <= 0.0 && !slack) {
                return Seen::Bad(format!(
                    "stiffness {given:?} N/m where the shear tangent is {:.3e} N/m: bounds are positive, but for a \
                     sheet without stiffness in shear",
                    shear[l]
                ));
            }
            let ratio = steepest[l] / given[0];
            least = least.min(ratio);
            if worse(ratio, worst) {
                let metric = [0, 1, 2].map(|r| state.metric[r * LANES + l]);
                (worst, place) = (ratio, format!("{metric:.4?}"));
            }
            let ratio = if slack { 0.0 } else { shear[l] / given[1] };
            if worse(ratio, soft) {
                soft = ratio;
            }
        }
    }
    Seen::Number {
        measured: if worse(worst, soft) { worst } else { soft },
        limit: 1.0 + 1e-3,
        what: format!(
            "true largest tangents are {least:.2} to {worst:.2} of the given bound ({RANGE}; worst at C = {place}), shear \
             tangents at most {soft:.2}"
        ),
    }
}
