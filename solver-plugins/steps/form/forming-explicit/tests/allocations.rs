//! The loop over steps allocates nothing, but in the steps in which a ply that may touch itself looks for new pairs, or the model asks
//! its elements whether they still are some.
//!
//! One test in a binary of its own: the allocator that counts is that of the whole process.

mod common;

use common::scenes::{bag, press};
use common::{BuiltIn, woven};
use plyflow_forming_explicit::{Forming, Parameters, build_global};
use plyflow_mechanics::model::ASK_INTERVAL;
use serde_json::json;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The system's allocator; counts what the threads of a run's pool ask for, and not what the test harness does beside them.
struct Counting;

static ASKED: AtomicU64 = AtomicU64::new(0);

thread_local! {
    // Neither made nor dropped with an allocation.
    static COUNTED: Cell<bool> = const { Cell::new(false) };
}

fn count() {
    if COUNTED.get() {
        ASKED.fetch_add(1, Relaxed);
    }
}

// SAFETY: hands everything on to the system's allocator as it came, and gives back what that gives.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: what the caller promises is what the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: what the caller promises is what the system's allocator asks for.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: what the caller promises is what the system's allocator asks for.
        unsafe { System.dealloc(place, layout) }
    }
    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: what the caller promises is what the system's allocator asks for.
        unsafe { System.realloc(place, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Searches of all plies for pairs of their own.
fn searches(forming: &Forming) -> u64 {
    let contacts = forming.model.self_contacts().iter();
    contacts.map(|c| c.searches).sum()
}

/// Runs `warm` steps and then 400 of which only those with a search, or with a question to the elements, may allocate.
fn assert_frugal(what: &str, p: &Parameters, threads: usize, warm: usize) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .start_handler(|_| COUNTED.set(true))
        .build()
        .unwrap();
    pool.install(|| {
        let before = ASKED.load(Relaxed);
        let mut forming = build_global(p, &BuiltIn).unwrap();
        assert!(ASKED.load(Relaxed) > before, "nothing is counted");
        let critical = forming.model.critical_step().unwrap();
        forming
            .model
            .set_step(p.time_step.min(p.step_safety * critical));
        let mut quiet = 0;
        for k in 0..warm + 400 {
            let (asked, searched) = (ASKED.load(Relaxed), searches(&forming));
            forming.load_at(forming.model.time());
            forming.model.step(false).unwrap();
            let asked = ASKED.load(Relaxed) - asked;
            let asks = forming.model.cycle().is_multiple_of(ASK_INTERVAL);
            if k >= warm && searches(&forming) == searched && !asks {
                quiet += 1;
                assert_eq!(asked, 0, "{what}, {threads} threads: step {k}");
            }
        }
        assert!(quiet >= 350, "{what}: {quiet} steps without a search");
        // Sheets, tool and plates touch, and so there is something to compute.
        let rigid = forming.model.rigid_contacts().iter();
        let touching = |f: f64| f > 0.0;
        let on_rigid = rigid
            .flat_map(|c| &c.items)
            .filter(|i| touching(i.normal_force.into()));
        let between = forming.model.sheet_contacts().iter().flat_map(|c| &c.items);
        let between = between.filter(|i| i.active).count();
        let sheets = forming.model.sheets().len();
        assert!(
            on_rigid.count() > 10 && (sheets == 1 || between > 10),
            "{what}"
        );
    });
}

#[test]
fn steps_between_two_searches_allocate_nothing() {
    let hold = json!({"force": "200 N"});
    let shell = |element: &str| {
        press(1, &hold, |p| {
            p["element"]["plugin"] = json!(element);
            p["scene"]["sheets"][0]["material"] = woven();
            if element == "s4" {
                p["element"]["with"] = json!({});
            }
        })
    };
    // Sealed from 0.18 s, step 15000, on: then the volume under the films is measured in every step.
    let bag = bag(1, |p| p["element_size"] = json!(0.01));
    for threads in [1, 2] {
        assert_frugal(
            "two plies in a press",
            &press(2, &hold, |_| {}),
            threads,
            3000,
        );
        assert_frugal("rf4 in a press", &shell("rf4"), threads, 3000);
        assert_frugal("s4 in a press", &shell("s4"), threads, 3000);
        assert_frugal("a bag", &bag, threads, 16000);
    }
}
