//! What a reader may hold while it reads one input: an allocator that counts.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Most bytes that the reading of one input may hold above what was held before. Inputs have at most [`LONGEST`] bytes.
pub const BUDGET: usize = 256 << 20;

/// Longest input (bytes).
pub const LONGEST: usize = 1 << 16;

static LIVE: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(usize::MAX);
static NAME: AtomicPtr<u8> = AtomicPtr::new(std::ptr::null_mut());
static NAME_LENGTH: AtomicUsize = AtomicUsize::new(0);
static ONE: Mutex<()> = Mutex::new(());

/// The allocator of programs that run targets: beyond the budget there is no memory, which ends the process with a word on it.
#[derive(Debug)]
pub struct Counted;

impl Counted {
    /// Takes bytes from the budget; false when there are not so many left.
    fn take(bytes: usize) -> bool {
        let held = LIVE
            .fetch_add(bytes, Ordering::Relaxed)
            .saturating_add(bytes);
        if held <= MOST.load(Ordering::Relaxed) {
            return true;
        }
        LIVE.fetch_sub(bytes, Ordering::Relaxed);
        tell();
        false
    }
}

/// Says what went beyond the budget, without allocating.
fn tell() {
    let length = NAME_LENGTH.load(Ordering::Relaxed);
    let name = NAME.load(Ordering::Relaxed).cast_const();
    for (text, length) in [
        (c"beyond the memory budget: ".as_ptr().cast(), 26),
        (name, if name.is_null() { 0 } else { length }),
        (c"\n".as_ptr().cast(), 1),
    ] {
        // SAFETY: the texts are static, and a name is leaked and of this length.
        unsafe { libc::write(2, text.cast(), length) };
    }
}

// SAFETY: every call goes to the system's allocator with the layout that came in; what is refused gives null, as the trait allows.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        match Self::take(layout.size()) {
            // SAFETY: as the caller promises.
            true => unsafe { System.alloc(layout) },
            false => std::ptr::null_mut(),
        }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        match Self::take(layout.size()) {
            // SAFETY: as the caller promises.
            true => unsafe { System.alloc_zeroed(layout) },
            false => std::ptr::null_mut(),
        }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(at, layout) };
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let more = size.saturating_sub(layout.size());
        if !Self::take(more) {
            return std::ptr::null_mut();
        }
        LIVE.fetch_sub(layout.size().saturating_sub(size), Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(at, layout, size) }
    }
}

/// Runs one input within the budget; `name` is told when it goes beyond. One runs at a time.
pub fn within_budget(name: &'static str, run: impl FnOnce()) {
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    NAME_LENGTH.store(name.len(), Ordering::Relaxed);
    NAME.store(name.as_ptr().cast_mut(), Ordering::Relaxed);
    MOST.store(
        LIVE.load(Ordering::Relaxed).saturating_add(BUDGET),
        Ordering::Relaxed,
    );
    let free = Unbound;
    run();
    drop(free);
}

/// Takes the bound away, also when a target panics.
struct Unbound;

impl Drop for Unbound {
    fn drop(&mut self) {
        MOST.store(usize::MAX, Ordering::Relaxed);
    }
}
