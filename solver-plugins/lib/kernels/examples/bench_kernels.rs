//! Element-steps per second of one core, through the C tables, on data that a forming run would
//! have: `cargo run --release -p plyflow-kernels --example bench_kernels`. One JSON row per case, with its cost over that of an operation
//! of a calibrating loop which takes turns with it. `-- --short`: the widest instruction set alone, each case for a quarter of a second.

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/s4_support/mod.rs"]
mod s4_support;

use common::{El, FILM, Mat, fabric, film, ncf, woven};
use plyflow_kernels::{Level, limit_level, m4::M4, m4f::M4f, rf4::Rf4};
use plyflow_sdk::Element;
use std::alloc::{GlobalAlloc, Layout, System};
use std::hint::black_box;
use std::time::Instant;

/// Every array on a cache line of its own, as the ABI asks of hosts: otherwise each load of eight lanes
/// would cross a line, and AVX-512 would look slower than AVX2.
struct Lines;

#[global_allocator]
static LINES: Lines = Lines;

fn on_lines(layout: Layout) -> Layout {
    layout
        .align_to(64)
        .expect("a size that has room for 64 more")
}

// SAFETY: the system's allocator with a stricter alignment, which serves who asks for a lesser one, the same in both calls. It grows by the
// trait's own `realloc`, which is made of these two.
unsafe impl GlobalAlloc for Lines {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: a layout of the size that the caller promises to be more than 0.
        unsafe { System.alloc(on_lines(layout)) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: from `alloc`, with the layout that it was given there.
        unsafe { System.dealloc(pointer, on_lines(layout)) }
    }
}

const LANES: usize = 32;
/// Their positions, forces and constants, at most 20 KB for a batch, stay in a second-level cache of 1 MB, as a
/// thread's workspace does in a run.
const BATCHES: usize = 16;
/// How long a case is timed (s).
fn watched() -> f64 {
    if is_short() { 0.25 } else { 1.0 }
}

fn is_short() -> bool {
    std::env::args().any(|word| word == "--short")
}

fn main() {
    for level in [Level::Avx512, Level::Avx2, Level::Portable] {
        if limit_level(level) == level {
            cases();
            if is_short() {
                return;
            }
        }
    }
}

/// Operations of a slice of the calibrating loop.
const OPERATIONS: usize = 64 * 2_000;

/// Multiplications and additions on numbers that stay in registers, without wide instructions.
fn calibrate() -> f64 {
    let mut a = [1.0f64; 64];
    let (b, c) = (black_box(0.999_999), black_box(1e-6));
    for _ in 0..black_box(OPERATIONS / 64) {
        for a in &mut a {
            *a = *a * b + c;
        }
    }
    a.iter().sum()
}

fn cases() {
    let ncf = |form: &str| fabric(&ncf(form, "")).expect("the material is valid");
    // A linear law of a few operations: what is left is the element's own.
    let plain = s4_support::plate(1e8, 0.3, 4e-4);
    elements::<M4>("m4", "linear isotropic", &plain);
    patches("linear isotropic", &plain);
    shells("linear isotropic", "{}", &plain);
    elements::<M4>("m4", "ncf fibre-energy", &ncf("fibre-energy"));
    elements::<M4>(
        "m4",
        "woven fibre-energy",
        &fabric(&woven("fibre-energy")).expect("valid"),
    );
    elements::<M4>("m4", "ncf hypoelastic", &ncf("hypoelastic"));
    elements::<M4>("m4", "film", &film(FILM).expect("valid"));
    elements::<M4f>("m4f", "film", &film(FILM).expect("valid"));
    elements::<M4f>("m4f", "linear isotropic", &plain);
    patches("ncf fibre-energy", &ncf("fibre-energy"));
    shells("ncf fibre-energy", "{}", &ncf("fibre-energy"));
    let total = r#"{"bending":"total","twist":"material"}"#;
    shells(
        "ncf fibre-energy, total, one point",
        total,
        &ncf("fibre-energy"),
    );
}

/// `s4` on moved and turned elements; the directors go on turning.
fn shells(name: &str, json: &str, material: &Mat) {
    let s = s4_support::Shell::new(json, material).expect("the element is valid");
    let mut r = common::Random(11);
    let mut data = Vec::new();
    for _ in 0..BATCHES {
        let reference: Vec<_> = (0..LANES).map(|_| common::flat(&mut r, 0.1)).collect();
        let moved: Vec<_> = reference
            .iter()
            .map(|q| q.map(|[x, y, z]| [x + 0.2 * y, y * 1.01, z + 5e-4 * r.next()]))
            .collect();
        let spin: Vec<f64> = (0..12 * LANES).map(|_| 100.0 * r.next()).collect();
        let zeros = || vec![0.0; 12 * LANES];
        let batch = s.start(&reference, [0.8, 0.6, 0.0]);
        data.push((
            batch,
            common::rows(&moved),
            spin,
            [zeros(), zeros(), zeros()],
        ));
    }
    let rate = best(
        || {
            for (batch, position, spin, [force, moment, energy]) in &mut data {
                s.forces_into(batch, position, spin, [force, moment, energy]);
            }
        },
        LANES * BATCHES,
    );
    row("s4", name, "element", rate);
}

/// Rate of a case (1/s), and what one piece of its work takes over an operation of the calibrating loop.
#[derive(Clone, Copy)]
struct Rate {
    per_second: f64,
    calibrations: f64,
}

fn row(element: &str, material: &str, what: &str, rate: Rate) {
    println!(
        r#"{{"element":"{element}","material":"{material}","part":"{what}","lanes":"{:?}","million_per_second":{:.1},"calibrations":{:.3}}}"#,
        plyflow_kernels::level(),
        rate.per_second * 1e-6,
        rate.calibrations
    );
}

/// `count` pieces of work over the shortest time that a slice of some milliseconds has taken: others who use the
/// machine only make a slice longer.
fn best(mut work: impl FnMut(), count: usize) -> Rate {
    const PASSES: usize = 50;
    let timed = |f: &mut dyn FnMut()| {
        let start = Instant::now();
        f();
        start.elapsed().as_secs_f64()
    };
    let (mut fastest, mut loops) = (f64::INFINITY, f64::INFINITY);
    let watch = Instant::now();
    while watch.elapsed().as_secs_f64() < watched() {
        fastest = fastest.min(timed(&mut || {
            for _ in 0..PASSES {
                work();
            }
        }));
        loops = loops.min(timed(&mut || {
            black_box(calibrate());
        }));
    }
    let pieces = (PASSES * count) as f64;
    Rate {
        per_second: pieces / fastest,
        calibrations: (fastest / pieces) / (loops / OPERATIONS as f64),
    }
}

fn elements<E: Element>(element: &str, name: &str, material: &Mat) -> Rate {
    let e = El::new::<E>("{}", material).expect("the element is valid");
    let mut r = common::Random(7);
    let mut data = Vec::new();
    for _ in 0..BATCHES {
        let quad = |r: &mut common::Random, z: f64| {
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
                .map(|[x, y]: [f64; 2]| [x + 0.1 * r.next(), y + 0.1 * r.next(), z * r.next()])
                .map(|p| p.map(|c| 0.005 * c))
        };
        let reference: Vec<_> = (0..LANES).map(|_| quad(&mut r, 0.0)).collect();
        let moved: Vec<_> = reference
            .iter()
            .map(|q| q.map(|[x, y, z]| [x + 0.2 * y, y * 1.01, z + 5e-4 * r.next()]))
            .collect();
        let batch = e.initialise(&reference, &[[0.8, 0.6, 0.0]; LANES]);
        let (n, f) = (LANES, common::rows(&moved));
        data.push((
            batch,
            f,
            vec![0.0; 12 * n],
            vec![0.0; 3 * n],
            vec![0.0; 12 * n],
        ));
    }
    let rate = best(
        || {
            for (batch, position, force, energy, velocity) in &mut data {
                e.forces_into(batch, position, velocity, force, energy);
            }
        },
        LANES * BATCHES,
    );
    row(element, name, "element", rate);
    rate
}

/// Patches of a structured mesh, and what elements and patches together make of a shell.
fn patches(name: &str, material: &Mat) {
    let e = El::new::<Rf4>("{}", material).expect("the element is valid");
    let ring = [
        [0, 0],
        [1, 0],
        [1, 1],
        [0, 1],
        [-1, 1],
        [-1, 0],
        [-1, -1],
        [0, -1],
        [1, -1],
    ];
    let mut r = common::Random(9);
    let mut patch = |z: f64| -> Vec<Vec<[f64; 3]>> {
        (0..LANES)
            .map(|_| {
                ring.map(|[i, j]| [0.005 * i as f64, 0.005 * j as f64, z * r.next()])
                    .into()
            })
            .collect()
    };
    // The patches of a regular mesh share their constants, as in the solver.
    let mut shared = e.initialise_patches(&patch(0.0), [0.8, 0.6, 0.0], 2.5e-5);
    let mut data: Vec<_> = (0..BATCHES)
        .map(|_| {
            let rows = e.patch_rows(&patch(1e-4));
            (rows.clone(), rows, vec![0.0; LANES])
        })
        .collect();
    let rate = best(
        || {
            for (position, force, energy) in &mut data {
                e.patch_forces_into(&mut shared, position, force, energy);
            }
        },
        LANES * BATCHES,
    );
    row("rf4", name, "patch", rate);
    let membrane = elements::<Rf4>("rf4", name, material);
    let both = Rate {
        per_second: 1.0 / (1.0 / rate.per_second + 1.0 / membrane.per_second),
        calibrations: rate.calibrations + membrane.calibrations,
    };
    row("rf4", name, "element + patch", both);
}
