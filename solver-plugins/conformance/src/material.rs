//! Checks of a material: the membrane part.

use crate::buffer::Guarded;
use crate::linear::largest_eigenvalue;
use crate::meeting::{THREADS, meet};
use crate::shapes::pick;
use crate::subject::{Ask, Breaches, DT};
use crate::{Check, Run, Seen, Sequence, Sink, bending, rules, worse};
use plyflow_sdk::abi::*;
use std::ffi::c_void;

const LANES: usize = 16;
const STRAIN: f64 = 0.02;
/// Calls of a thread between two looks at whether enough have met.
const CALLS: usize = 1000;

/// A material under test.
pub(crate) struct Law {
    functions: *const pf_material_functions,
    instance: *mut c_void,
    pub(crate) sizes: pf_material_sizes,
}

// The contract: several threads call one instance at once. That is what is tested.
unsafe impl Sync for Law {}
unsafe impl Send for Law {}

impl Drop for Law {
    fn drop(&mut self) {
        unsafe { ((*self.functions).destroy)(self.instance) };
    }
}

/// What a membrane call gave.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    /// `[3][lanes]`
    pub(crate) stress: Vec<f64>,
    /// `[lanes]`
    pub(crate) energy: Vec<f64>,
    /// `[2][lanes]`; empty when not asked for.
    pub(crate) stiffness: Vec<f64>,
    pub(crate) breaches: Breaches,
}

impl Law {
    /// # Safety
    /// `functions` must be valid as long as the law lives.
    unsafe fn create(
        functions: *const pf_material_functions,
        parameters: &str,
    ) -> Result<Self, String> {
        let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
        let text = pf_str::new(parameters);
        let code = unsafe { ((*functions).create)(text, &raw mut instance, &raw mut error) };
        if code != PF_OK {
            return Err(format!("create returned {code}: {}", error.get()));
        }
        if instance.is_null() {
            return Err("create returned 0 (PF_OK) but left the instance NULL".into());
        }
        let mut new = Self {
            functions,
            instance,
            sizes: pf_material_sizes {
                size: size_of::<pf_material_sizes>() as u64,
                ..pf_material_sizes::default()
            },
        };
        let code = unsafe { ((*functions).sizes)(instance, &raw mut new.sizes) };
        if code != PF_OK {
            return Err(format!("sizes returned {code}"));
        }
        Ok(new)
    }

    pub(crate) fn bends(&self) -> bool {
        self.sizes.has_bending != 0
    }

    pub(crate) fn functions(&self) -> &pf_material_functions {
        unsafe { &*self.functions }
    }

    pub(crate) fn instance(&self) -> *const c_void {
        self.instance
    }

    fn start(&self, lanes: usize) -> Guarded {
        Guarded::zeros(self.sizes.membrane_history as usize * lanes)
    }

    fn membrane(&self, history: &mut Guarded, metric: &[f64], ask: Ask) -> Answer {
        let lanes = metric.len() / 3;
        let mut c = Guarded::of(metric);
        let mut stress = Guarded::poisoned(3 * lanes);
        let mut energy = Guarded::poisoned(lanes);
        let wanted = ask == Ask::Everything;
        let mut stiffness = Guarded::poisoned(if wanted { 2 * lanes } else { 0 });
        let batch = pf_membrane_batch {
            size: size_of::<pf_membrane_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt: DT,
            metric: c.pointer(),
            history: history.pointer(),
            stress: stress.pointer(),
            energy: energy.pointer(),
            stiffness: if wanted {
                stiffness.pointer()
            } else {
                std::ptr::null_mut()
            },
        };
        let code = unsafe { ((*self.functions).membrane)(self.instance, &raw const batch) };
        let mut b = Breaches::default();
        let call = "membrane";
        b.status(call, code);
        b.unchanged(call, "metric", &c, metric);
        b.zones(call, "history", history);
        b.output(call, "stress", &stress, lanes);
        b.output(call, "energy", &energy, lanes);
        b.output(call, "stiffness", &stiffness, lanes);
        Answer {
            stress: stress.slice().to_vec(),
            energy: energy.slice().to_vec(),
            stiffness: stiffness.slice().to_vec(),
            breaches: b,
        }
    }
}

/// C11, C22, C12 of a random deformation of about `size`; lane 0 of pure shear.
pub(crate) fn metrics(lanes: usize, size: f64, seed: u64) -> Vec<f64> {
    let mut s = Sequence(seed);
    let mut metric = vec![0.0; 3 * lanes];
    for l in 0..lanes {
        let f = [1.0 + size * s.next(), size * s.next()];
        let g = [size * s.next(), 1.0 + size * s.next()];
        metric[l] = f[0] * f[0] + g[0] * g[0];
        metric[lanes + l] = f[1] * f[1] + g[1] * g[1];
        metric[2 * lanes + l] = f[0] * f[1] + g[0] * g[1];
    }
    metric
}

fn undeformed(lanes: usize) -> Vec<f64> {
    (0..3 * lanes)
        .map(|i| if i < 2 * lanes { 1.0 } else { 0.0 })
        .collect()
}

/// Checks a material made with `parameters` (JSON, SI numbers, with `thickness` and `areal_mass`): its membrane part
/// and, when it has one, its bending.
///
/// # Safety
/// `functions` must be a valid table for the length of the call.
#[must_use]
pub unsafe fn check_material(
    functions: *const pf_material_functions,
    parameters: &str,
    sink: &mut dyn Sink,
) -> Vec<Check> {
    let mut run = Run::new(sink);
    let create = || unsafe { Law::create(functions, parameters) };
    let (mut law, mut twin) = (None, None);
    run.check(rules::CREATE, || match (create(), create()) {
        (Ok(a), Ok(b)) => {
            (law, twin) = (Some(a), Some(b));
            Seen::Well("made twice from the same parameters".into())
        }
        (Err(text), _) | (_, Err(text)) => Seen::Bad(text),
    });
    if let (Some(law), Some(twin)) = (&law, &twin)
        && run.check(
            crate::Rule {
                expected: "thickness and areal mass are positive, bending is there when has_bending is 1",
                remedy: "take thickness and areal_mass from the parameters",
                ..rules::SIZES
            },
            || sizes(law),
        )
    {
        if calls(&mut run, law) {
            judge(&mut run, law, twin);
        }
        bending::judge(&mut run, law);
    }
    run.finish()
}

fn sizes(law: &Law) -> Seen {
    let s = &law.sizes;
    let given = format!(
        "thickness {} m, areal mass {} kg/m2, {} membrane and {} bending history, has_bending {}",
        s.thickness, s.areal_mass, s.membrane_history, s.bending_history, s.has_bending
    );
    let positive = s.thickness > 0.0 && s.areal_mass > 0.0;
    let sane = s.membrane_history.max(s.bending_history) < 10_000 && s.has_bending <= 1;
    if positive && sane && (s.has_bending == 0 || law.functions().bending.is_some()) {
        Seen::Well(given)
    } else {
        Seen::Bad(given)
    }
}

fn calls(run: &mut Run<'_>, law: &Law) -> bool {
    let mut all = Breaches::default();
    let well = run.check(rules::STATUS, || {
        for (lanes, strain) in [(8, 0.0), (8, STRAIN), (24, STRAIN), (64, STRAIN), (64, 0.3)] {
            for ask in [Ask::Nothing, Ask::Everything] {
                let mut history = law.start(lanes);
                let rest = law.membrane(&mut history, &undeformed(lanes), ask);
                all.add(rest.breaches);
                let a = law.membrane(&mut history, &metrics(lanes, strain, 61), ask);
                all.add(a.breaches);
            }
        }
        match all.status.take() {
            Some(text) => Seen::Bad(text),
            None => Seen::Well("10 batches of 8 to 64 lanes, strains to 30 %".into()),
        }
    });
    let mut verdict = |rule, fault: Option<String>, what: &str| {
        run.check(rule, || match fault {
            Some(text) => Seen::Bad(text),
            None => Seen::Well(what.into()),
        })
    };
    let what = "4 KiB before and after each buffer are untouched";
    verdict(rules::GUARDS, all.guards, what);
    let whole = verdict(rules::COMPLETE, all.gaps, "all outputs are written");
    let finite = verdict(rules::FINITE, all.finite, "all outputs are finite");
    let on = well && whole && finite;
    if !on {
        run.skip(&rules::OF_MATERIALS, "not checked: repair the above first");
    }
    on
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
        let (history, a) = once(law, metric, Ask::Everything);
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
        let metric = metrics(64, 0.05, 71);
        let whole = all(law, &metric);
        for width in (8..=64).step_by(8) {
            let order: Vec<usize> = (0..width).map(|i| (87 - i) % 64).collect();
            let part = all(law, &pick(&metric, 64, &order));
            if let Some(to) = (0..width).find(|to| part[*to] != whole[order[*to]]) {
                return Seen::Bad(format!(
                    "lane {} of 64 differs from the same state in lane {to} of {width}",
                    order[to]
                ));
            }
        }
        Seen::Well("same bits in batches of 8, 16, .. 64 lanes in other orders".into())
    });
    run.check(rules::ASKING, || {
        let mut with = once(law, &metric, Ask::Everything);
        let without = once(law, &metric, Ask::Nothing);
        with.1.stiffness.clear();
        let same = |l| bits(&with.0, &with.1, LANES, l) == bits(&without.0, &without.1, LANES, l);
        if (0..LANES).all(same) {
            Seen::Well("same bits with and without stiffness".into())
        } else {
            Seen::Bad("stress, energy or history differ when stiffness is NULL".into())
        }
    });
    run.check(rules::THREADS, || {
        let sets: Vec<Vec<f64>> = (0..THREADS)
            .map(|t| metrics(LANES, STRAIN, 201 + 2 * t as u64))
            .collect();
        let alone: Vec<_> = sets.iter().map(|m| all(law, m)).collect();
        let met = meet(|t, counter| {
            let (m, want) = (&sets[t], &alone[t]);
            let differs = |_: &usize| counter.during(|| all(law, m)) != *want;
            (CALLS, (0..CALLS).filter(differs).count())
        });
        Seen::Number {
            measured: met.differing as f64,
            limit: 0.0,
            what: met.told(),
        }
    });
    run.check(rules::REST, || rest(law, &metric));
    run.check(rules::STRESS, || stress(law));
    run.check(rules::CYCLE, || cycle(law));
    run.check(rules::TANGENT, || tangent(law));
}

pub(crate) fn size(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| v.abs().max(m))
}

/// To divide by.
pub(crate) fn largest(values: &[f64]) -> f64 {
    size(values).max(f64::MIN_POSITIVE)
}

fn rest(law: &Law, metric: &[f64]) -> Seen {
    let a = once(law, metric, Ask::Nothing).1;
    let rest = law.membrane(&mut law.start(LANES), &undeformed(LANES), Ask::Nothing);
    let (s, w) = (
        size(&rest.stress) / largest(&a.stress),
        size(&rest.energy) / largest(&a.energy),
    );
    Seen::Number {
        measured: s.max(w),
        limit: 1e-9,
        what: format!("stress at rest {s:.1e} of that at 2 % strain, energy {w:.1e}"),
    }
}

/// Answers at a metric with component `row` moved to and fro by `h`, from copies of the history.
fn either_side(law: &Law, history: &Guarded, metric: &[f64], row: usize, h: f64) -> [Answer; 2] {
    let lanes = metric.len() / 3;
    [h, -h].map(|by| {
        let mut m = metric.to_vec();
        for c in &mut m[row * lanes..(row + 1) * lanes] {
            *c += by;
        }
        law.membrane(&mut history.clone(), &m, Ask::Nothing)
    })
}

const STATES: [(f64, u64); 3] = [(0.005, 73), (STRAIN, 79), (0.1, 83)];

/// Steps of the metric. An energy that is computed as a difference of large terms is noisy: the noise over a small
/// step is an error of its derivative. A large one may reach over a kink. A right stress is right by one of them, a
/// wrong one by none.
const WIDTHS: [f64; 2] = [1e-6, 1e-4];

fn stress(law: &Law) -> Seen {
    let mut worst = (0.0, String::new());
    for (size, seed) in STATES {
        let metric = metrics(LANES, size, seed);
        let (history, a) = once(law, &metric, Ask::Nothing);
        for (row, factor) in [(0, 2.0), (1, 2.0), (2, 1.0)] {
            let sides = WIDTHS.map(|h| either_side(law, &history, &metric, row, h));
            // Each component by its own size: a fabric's shear stress is a thousandth of its fibre stress.
            let own = largest(&a.stress[row * LANES..(row + 1) * LANES]);
            let scale = own.max(1e-9 * largest(&a.stress));
            for l in 0..LANES {
                let got = a.stress[row * LANES + l];
                let by = |i: usize| {
                    let [up, down] = &sides[i];
                    factor * (up.energy[l] - down.energy[l]) / (2.0 * WIDTHS[i])
                };
                let (small, large) = (by(0), by(1));
                let nearer = (got - small).abs() <= (got - large).abs();
                let want = if nearer { small } else { large };
                let error = (got - want).abs() / scale;
                if worse(error, worst.0) {
                    let name = ["S11", "S22", "S12"][row];
                    worst = (
                        error,
                        format!("{name} is {got:.6e} N/m, the energy's derivative {want:.6e} N/m"),
                    );
                }
            }
        }
    }
    Seen::Number {
        measured: worst.0,
        limit: 1e-4,
        what: format!(
            "off by {:.1e} of the component's largest; {}",
            worst.0, worst.1
        ),
    }
}

/// The largest gain of energy over closed cycles of strain, over the largest energy in the cycle, and the largest
/// difference of the work from the energy.
fn cycle(law: &Law) -> Seen {
    const N: usize = 2000;
    let (mut gain, mut apart) = (0.0f64, 0.0f64);
    for (size, seed) in STATES {
        let (a, b) = (metrics(LANES, size, seed), metrics(LANES, size, seed + 100));
        let one = undeformed(LANES);
        let at = |t: f64| -> Vec<f64> {
            let (s, c) = t.sin_cos();
            (0..one.len())
                .map(|i| one[i] + s * (a[i] - one[i]) + (1.0 - c) * 0.5 * (b[i] - one[i]))
                .collect()
        };
        let mut history = law.start(LANES);
        let mut before = one.clone();
        let mut old = law.membrane(&mut history, &before, Ask::Nothing);
        let (mut work, mut peak) = (vec![0.0; LANES], vec![f64::MIN_POSITIVE; LANES]);
        let mut off = [0.0f64; LANES];
        for i in 1..=N {
            let m = at(std::f64::consts::TAU * i as f64 / N as f64);
            let new = law.membrane(&mut history, &m, Ask::Nothing);
            for l in 0..LANES {
                for (row, factor) in [(0, 0.5), (1, 0.5), (2, 1.0)] {
                    let j = row * LANES + l;
                    work[l] += factor * 0.5 * (old.stress[j] + new.stress[j]) * (m[j] - before[j]);
                }
                peak[l] = f64::max(peak[l], new.energy[l].abs());
                off[l] = f64::max(off[l], (work[l] - new.energy[l]).abs());
            }
            (before, old) = (m, new);
        }
        for l in 0..LANES {
            gain = gain.max(-work[l] / peak[l]);
            apart = apart.max(off[l] / peak[l]);
        }
    }
    Seen::Number {
        measured: gain.max(apart),
        limit: 1e-2,
        what: format!(
            "over 48 closed cycles the sheet gave back at most {:.1e} of the peak energy more than was put in; work \
             and energy differ by {apart:.1e}",
            gain.max(0.0)
        ),
    }
}

/// dS/dE as a symmetric matrix of tensor components (with a factor of root 2 for shear), against its bound.
fn tangent(law: &Law) -> Seen {
    let h = 1e-6;
    let (mut worst, mut least, mut soft) = (0.0f64, f64::INFINITY, 0.0f64);
    for (size, seed) in STATES {
        let metric = metrics(LANES, size, seed);
        let (history, a) = once(law, &metric, Ask::Everything);
        let mut d = vec![[0.0; 9]; LANES];
        let root = 2.0f64.sqrt();
        // E11 = (C11 - 1) / 2; the third component is root 2 E12 = C12 / root 2.
        let of_stress = [1.0, 1.0, root];
        let of_metric = [2.0, 2.0, root];
        for column in 0..3 {
            let [up, down] = either_side(law, &history, &metric, column, h);
            for (l, d) in d.iter_mut().enumerate() {
                for row in 0..3 {
                    let j = row * LANES + l;
                    let slope = (up.stress[j] - down.stress[j]) / (2.0 * h);
                    d[3 * row + column] = slope * of_stress[row] * of_metric[column];
                }
            }
        }
        for (l, d) in d.iter().enumerate() {
            let given = [a.stiffness[l], a.stiffness[LANES + l]];
            if given.iter().any(|g| *g <= 0.0) {
                return Seen::Bad(format!("stiffness {given:?} N/m: bounds are positive"));
            }
            let ratio = largest_eigenvalue(d, 3) / given[0];
            worst = worst.max(ratio);
            least = least.min(ratio);
            // dS12 / d(2 E12) = dS12 / dC12
            soft = soft.max(0.5 * d[8] / given[1]);
        }
    }
    Seen::Number {
        measured: worst.max(soft),
        limit: 1.0 + 1e-3,
        what: format!(
            "true largest tangents are {least:.2} to {worst:.2} of the given bound, shear tangents at most {soft:.2}"
        ),
    }
}
