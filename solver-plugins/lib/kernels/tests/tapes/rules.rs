//! What cannot be written down is found, and what is wrong does not go through.

use crate::common::ncf;
use crate::support::{Both, Buffers, LANES, Random, compiled, metric};
use plyflow_kernels::fabric::Fabric;
use plyflow_kernels::record::{self, Recording};
use plyflow_kernels::{Lanes, Portable};
use plyflow_sdk::{Material, MaterialSizes, MembraneBatch};
use plyflow_tape::{Operation, Tape};

/// A material that does with its batch what it is told to.
struct Does(fn(&mut MembraneBatch<'_>));

impl Material for Does {
    const MANIFEST: &'static str = "{}";
    fn create(_: &str) -> Result<Self, String> {
        Err("it is made by the test".into())
    }
    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            membrane_history: 0,
            bending_history: 0,
            has_bending: false,
            thickness: 1e-3,
            areal_mass: 1.0,
        }
    }
    fn membrane(&self, batch: &mut MembraneBatch<'_>) {
        batch.stress.fill(0.0);
        batch.energy.fill(0.0);
        self.0(batch);
    }
}

fn told(does: fn(&mut MembraneBatch<'_>)) -> String {
    record::membrane(&Does(does), false).expect_err("it cannot be written down")
}

#[test]
fn what_is_computed_outside_of_lanes_is_found_with_its_row() {
    let told_of_sum = told(|b| {
        for l in 0..b.lanes {
            b.stress[l] = 2.0 * b.metric[l];
        }
    });
    assert_eq!(
        told_of_sum,
        "row 0 of 'stress': a number was computed outside of lanes, from what hangs on a state"
    );
    let told_of_shift = told(|b| {
        let (n, metric) = (b.lanes, b.metric);
        b.stress[n..n + 4].copy_from_slice(&metric[4..8]);
        b.stress[n + 4..2 * n].copy_from_slice(&metric[..4]);
    });
    assert!(
        told_of_shift.starts_with("row 1 of 'stress': "),
        "{told_of_shift}"
    );
    let told_of_nothing = record::membrane(&Silent, false).expect_err("nothing is written");
    assert_eq!(
        told_of_nothing,
        "row 0 of 'stress': a row is read that was not written"
    );
    // Copied numbers are what they were, and constants are constants.
    let copied = record::membrane(
        &Does(|b| {
            let n = b.lanes;
            b.stress[..n].copy_from_slice(&b.metric[2 * n..]);
            b.energy.fill(3.0);
        }),
        false,
    );
    let copied = copied.expect("it is written down");
    assert!(
        copied
            .operations
            .contains(&Operation::Constant(3f64.to_bits()))
    );
}

/// Writes nothing at all.
struct Silent;

impl Material for Silent {
    const MANIFEST: &'static str = "{}";
    fn create(_: &str) -> Result<Self, String> {
        Err("it is made by the test".into())
    }
    fn sizes(&self) -> MaterialSizes {
        Does(|_| ()).sizes()
    }
    fn membrane(&self, _: &mut MembraneBatch<'_>) {}
}

#[test]
fn one_thread_records_one_thing_while_others_compute() {
    let recording = Recording::begin().expect("nothing is recorded");
    assert_eq!(
        Recording::begin().err().as_deref(),
        Some("this thread records already")
    );
    let others = std::thread::spawn(|| {
        let fabric = Fabric::create(&ncf("fibre-energy", "")).expect("a fabric");
        let (mut stress, mut energy) = ([0.0; 24], [0.0; 8]);
        let mut metric = [1.0; 24];
        metric[16..].fill(0.1);
        fabric.membrane(&mut MembraneBatch {
            lanes: 8,
            dt: 0.0,
            metric: &metric,
            history: &mut [0.0; 16],
            stress: &mut stress,
            energy: &mut energy,
            stiffness: None,
        });
        stress[16]
    });
    let shear = others.join().expect("it computes");
    assert!(shear > 1.0 && shear < 1e4, "{shear} N/m");
    drop(recording);
    let mut out = [0.0; 8];
    Portable::splat(2.0).sqrt().store(&mut out, 0);
    assert_eq!(out, [2f64.sqrt(); 8]);
    Recording::begin()
        .expect("the last one has ended")
        .finish()
        .expect("an empty tape");
}

/// The NCF's membrane over some states, as a changed tape has it.
fn holds(change: fn(&mut Tape)) {
    let fabric = Fabric::create(&ncf("fibre-energy", "")).expect("a fabric");
    let mut tape = record::membrane(&fabric, true).expect("a tape");
    change(&mut tape);
    let compiled = compiled(&[("membrane", &tape)]);
    let mut both = Both::new(&tape, &compiled, "membrane");
    let mut random = Random::new(3);
    let mut before = Buffers::new(&tape);
    for lane in 0..LANES {
        for (r, x) in metric(&mut random).into_iter().enumerate() {
            before.get_mut("metric")[r * LANES + lane] = x;
        }
    }
    let mut history = before.get("history").to_vec();
    let (mut stress, mut energy) = (vec![0.0; 3 * LANES], vec![0.0; LANES]);
    fabric.membrane(&mut MembraneBatch {
        lanes: LANES,
        dt: 0.0,
        metric: before.get("metric"),
        history: &mut history,
        stress: &mut stress,
        energy: &mut energy,
        stiffness: None,
    });
    both.hold(
        &before,
        &[
            ("stress", &stress),
            ("energy", &energy),
            ("history", &history),
        ],
    );
}

#[test]
fn a_tape_with_another_last_bit_in_one_constant_does_not_go_through() {
    holds(|_| ());
    let other = std::panic::catch_unwind(|| {
        holds(|tape| {
            let half = Operation::Constant(0.5f64.to_bits());
            let found = tape.operations.iter_mut().find(|o| **o == half);
            if let Some(Operation::Constant(bits)) = found {
                *bits += 1;
            }
        });
    });
    let told = other.expect_err("a bit is wrong");
    let told = told.downcast_ref::<String>().expect("a text");
    assert!(told.contains(" instead of "), "{told}");
}
