//! What it takes to hold a tool's field against its triangles.
//!
//! One test in a binary of its own: the allocator that counts is that of the whole process.

use plyflow_model::scene::Scene;
use plyflow_tooling::SignedDistanceGrid;
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// The system's allocator; counts what is held, and the most of it.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

fn more(bytes: usize) {
    let now = HELD.fetch_add(bytes, Relaxed) + bytes;
    MOST.fetch_max(now, Relaxed);
}

// SAFETY: hands everything on to the system's allocator as it came, and gives back what that gives.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        more(layout.size());
        // SAFETY: what the caller promises is what the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: what the caller promises is what the system's allocator asks for.
        unsafe { System.dealloc(place, layout) }
    }
    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        more(size);
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: what the caller promises is what the system's allocator asks for.
        unsafe { System.realloc(place, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_field_that_refines_itself_takes_less_than_60_megabytes_for_the_joggle_spar() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../workflows/joggle-spar");
    let text = std::fs::read_to_string(folder.join("scene.yaml")).unwrap();
    let scene = Scene::from_json(serde_saphyr::from_str(&text).unwrap()).unwrap();
    let mesh = plyflow_tooling::build_from(&scene.tool, &folder).unwrap();
    let before = HELD.load(Relaxed);
    MOST.store(before, Relaxed);
    let (tolerance, offset) = (4e-5, 9.6e-4);
    let (grid, error) =
        SignedDistanceGrid::build_within(&mesh, [3e-3, 1.2e-2], [tolerance, offset], &|_| true);
    assert!(error.largest <= tolerance, "{error:?}");
    let plain = SignedDistanceGrid::build(&mesh, 3e-3, 1.2e-2);
    assert!(grid.memory() > plain.memory(), "it was refined nowhere");
    let most = MOST.load(Relaxed) - before;
    eprintln!(
        "{} facets, {:.1} MB",
        mesh.triangles.len(),
        most as f64 / 1e6
    );
    // Half of what a step over this tool may take at its peak, some 100 MB. A record of each place that is looked at took 310 MB.
    assert!(most < 60_000_000, "{most} bytes");
}
