//! Checks of a material's bending part.

use crate::buffer::Guarded;
use crate::material::{Law, largest, metrics, size};
use crate::shapes::pick;
use crate::subject::{Ask, Breaches, DT};
use crate::{Run, Seen, Sequence, rules, worse};
use plyflow_sdk::abi::*;

const LANES: usize = 16;
/// Largest curvatures (1/m): a radius of 20 mm.
const CURVATURE: f64 = 50.0;

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
    let lanes = metric.len() / 3;
    let wanted = ask == Ask::Everything;
    let (mut c, mut k) = (Guarded::of(metric), Guarded::of(curvature));
    let mut moment = Guarded::poisoned(3 * lanes);
    let mut energy = Guarded::poisoned(lanes);
    let mut tangent = Guarded::poisoned(if wanted { 3 * lanes } else { 0 });
    let batch = pf_bending_batch {
        size: size_of::<pf_bending_batch>() as u64,
        lanes: lanes as u32,
        reserved: 0,
        dt: DT,
        metric: c.pointer(),
        curvature: k.pointer(),
        history: history.pointer(),
        moment: moment.pointer(),
        energy: energy.pointer(),
        tangent: if wanted {
            tangent.pointer()
        } else {
            std::ptr::null_mut()
        },
    };
    let mut b = Breaches::default();
    let name = "bending";
    if let Some(bending) = law.functions().bending {
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

fn curvatures(lanes: usize, seed: u64) -> Vec<f64> {
    let mut s = Sequence(seed);
    (0..3 * lanes).map(|_| CURVATURE * s.next()).collect()
}

pub(crate) fn judge(run: &mut Run<'_>, law: &Law) {
    if !law.bends() {
        return;
    }
    let well = run.check(rules::BENDING, || {
        let mut all = Breaches::default();
        for lanes in [8, 24, 64] {
            for ask in [Ask::Nothing, Ask::Everything] {
                let mut history = start(law, lanes);
                for seed in [89, 97] {
                    let (m, k) = (metrics(lanes, 0.02, seed), curvatures(lanes, seed));
                    all.add(call(law, &mut history, &m, &k, ask).breaches);
                }
            }
        }
        match all.any() {
            Some(text) => Seen::Bad(text),
            None => Seen::Well("12 batches of 8 to 64 lanes, curvatures to 50 1/m".into()),
        }
    });
    if !well {
        run.skip(&rules::OF_BENDING, "not checked: repair the above first");
        return;
    }
    run.check(rules::BENDING_LANES, || lanes(law));
    run.check(rules::BENDING_REST, || rest(law));
    run.check(rules::MOMENT, || moment(law));
    run.check(rules::BENDING_TANGENT, || tangent(law));
}

fn lanes(law: &Law) -> Seen {
    let (m, k) = (metrics(64, 0.02, 101), curvatures(64, 103));
    let all = |order: &[usize]| -> Vec<Vec<u64>> {
        let n = order.len();
        let mut history = start(law, n);
        let (m, k) = (pick(&m, 64, order), pick(&k, 64, order));
        let a = call(law, &mut history, &m, &k, Ask::Everything);
        let rows = [history.slice(), &a.moment, &a.energy, &a.tangent];
        (0..n)
            .map(|l| {
                let of = |r: &&[f64]| -> Vec<u64> {
                    r.chunks_exact(n).map(|row| row[l].to_bits()).collect()
                };
                rows.iter().flat_map(of).collect()
            })
            .collect()
    };
    let whole = all(&(0..64).collect::<Vec<_>>());
    for width in (8..=64).step_by(8) {
        let order: Vec<usize> = (0..width).map(|i| (87 - i) % 64).collect();
        let part = all(&order);
        if let Some(to) = (0..width).find(|to| part[*to] != whole[order[*to]]) {
            return Seen::Bad(format!(
                "lane {} of 64 differs from the same state in lane {to} of {width}",
                order[to]
            ));
        }
    }
    Seen::Well("same bits in batches of 8, 16, .. 64 lanes in other orders".into())
}

fn rest(law: &Law) -> Seen {
    let m = metrics(LANES, 0.02, 107);
    let a = call(
        law,
        &mut start(law, LANES),
        &m,
        &curvatures(LANES, 109),
        Ask::Nothing,
    );
    let flat = call(
        law,
        &mut start(law, LANES),
        &m,
        &[0.0; 3 * LANES],
        Ask::Nothing,
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

/// For each component the answers at curvatures moved to and fro by `h`, from copies of the history.
fn either_side(law: &Law, h: f64) -> (Answer, Vec<[Answer; 2]>) {
    let (m, k) = (metrics(LANES, 0.02, 107), curvatures(LANES, 109));
    let mut history = start(law, LANES);
    let a = call(law, &mut history, &m, &k, Ask::Everything);
    let sides = (0..3)
        .map(|row| {
            [h, -h].map(|by| {
                let mut k = k.clone();
                for x in &mut k[row * LANES..(row + 1) * LANES] {
                    *x += by;
                }
                call(law, &mut history.clone(), &m, &k, Ask::Nothing)
            })
        })
        .collect();
    (a, sides)
}

fn moment(law: &Law) -> Seen {
    let h = 1e-5 * CURVATURE;
    let (a, sides) = either_side(law, h);
    let mut worst = (0.0, String::new());
    for (row, [up, down]) in sides.iter().enumerate() {
        let factor = if row == 2 { 0.5 } else { 1.0 };
        for l in 0..LANES {
            let own = largest(&a.moment[row * LANES..(row + 1) * LANES]);
            let scale = own.max(1e-9 * largest(&a.moment));
            let want = factor * (up.energy[l] - down.energy[l]) / (2.0 * h);
            let got = a.moment[row * LANES + l];
            let error = (got - want).abs() / scale;
            if worse(error, worst.0) {
                let name = ["M11", "M22", "M12"][row];
                worst = (
                    error,
                    format!("{name} is {got:.6e} N, the energy's derivative {want:.6e} N"),
                );
            }
        }
    }
    let (m, k) = (metrics(LANES, 0.1, 113), curvatures(LANES, 109));
    let sheared = call(law, &mut start(law, LANES), &m, &k, Ask::Nothing);
    let differ = (0..3 * LANES).fold(0.0f64, |d, i| {
        d.max((sheared.moment[i] - a.moment[i]).abs())
    }) / largest(&a.moment);
    let note = if differ > 1e-9 {
        format!("; moments depend on the metric ({differ:.1e}): with rf4 the ledger will not close")
    } else {
        String::new()
    };
    Seen::Number {
        measured: worst.0,
        limit: 1e-4,
        what: format!(
            "off by {:.1e} of the component's largest; {}{note}",
            worst.0, worst.1
        ),
    }
}

fn tangent(law: &Law) -> Seen {
    let h = 1e-5 * CURVATURE;
    let (a, sides) = either_side(law, h);
    let mut worst = (0.0, String::new());
    for (row, [up, down]) in sides.iter().enumerate() {
        for l in 0..LANES {
            let i = row * LANES + l;
            let want = (up.moment[i] - down.moment[i]) / (2.0 * h);
            let got = a.tangent[i];
            let own = largest(&a.tangent[row * LANES..(row + 1) * LANES]);
            let scale = own.max(1e-9 * largest(&a.tangent));
            let error = (got - want).abs() / scale;
            if worse(error, worst.0) {
                let text = format!("component {row}: {got:.6e} N m, dM/dk is {want:.6e} N m");
                worst = (error, text);
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
