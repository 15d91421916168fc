//! libFuzzer over one target, which the variable `PLYFLOW_FUZZ_TARGET` names: `make fuzz` builds and starts it. With `PLYFLOW_FUZZ_TOOL` it does
//! instead what the words there say ([`plyflow_fuzz::tool`]), so that nothing else has to be built.
//!
//! It mutates inputs and keeps those that reach new code of the crates that are instrumented (`tests/fuzz/instrumented`). The functions below are
//! what libFuzzer calls; its archive has the `main`.

#![no_main]

use plyflow_fuzz::memory::Counted;
use plyflow_fuzz::mutate::{Dice, by_lines};
use plyflow_fuzz::{Target, patch, target, words};
use std::ffi::{c_char, c_int};
use std::sync::LazyLock;

#[global_allocator]
static MEMORY: Counted = Counted;

static TARGET: LazyLock<&Target> = LazyLock::new(|| {
    let name = std::env::var("PLYFLOW_FUZZ_TARGET").unwrap_or_default();
    target(&name).expect("PLYFLOW_FUZZ_TARGET is the name of a target")
});

static WORDS: LazyLock<Vec<String>> = LazyLock::new(|| words::of(TARGET.name));

unsafe extern "C" {
    /// libFuzzer's own mutations: changes `size` bytes in a place for `most`, and returns how many they are then.
    fn LLVMFuzzerMutate(data: *mut u8, size: usize, most: usize) -> usize;
}

/// Called once. A panic ends the process where it is, so that libFuzzer keeps the input, and nothing can catch it before.
#[unsafe(no_mangle)]
pub extern "C" fn LLVMFuzzerInitialize(_: *mut c_int, _: *mut *mut *mut c_char) -> c_int {
    if let Ok(line) = std::env::var("PLYFLOW_FUZZ_TOOL") {
        let words: Vec<&str> = line.split(' ').collect();
        std::process::exit(plyflow_fuzz::tool(&words));
    }
    let told = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        told(panic);
        std::process::abort();
    }));
    0
}

/// Called with every input.
///
/// # Safety
/// `data` has `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn LLVMFuzzerTestOneInput(data: *const u8, size: usize) -> c_int {
    let bytes = match size {
        // SAFETY: as the caller promises; of no bytes the place may be null.
        1.. => unsafe { std::slice::from_raw_parts(data, size) },
        0 => &[],
    };
    TARGET.run(bytes);
    0
}

/// Called for a mutation: half of them are libFuzzer's, the others know of lines and words, or of places in an artifact.
///
/// # Safety
/// `data` has `most` bytes, of which `size` are the input.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn LLVMFuzzerCustomMutator(
    data: *mut u8,
    size: usize,
    most: usize,
    seed: u32,
) -> usize {
    let mut dice = Dice::new(seed);
    let own = TARGET.lines || TARGET.name == "artifact";
    if !own || dice.below(2) == 0 {
        // SAFETY: as the caller promises.
        return unsafe { LLVMFuzzerMutate(data, size, most) };
    }
    // SAFETY: as the caller promises.
    let place = unsafe { std::slice::from_raw_parts_mut(data, most) };
    let mut bytes = place[..size].to_vec();
    for _ in 0..=dice.below(3) {
        match TARGET.lines {
            true => by_lines(&mut bytes, &WORDS, &mut dice),
            false => patch::grow(&mut bytes, &mut dice),
        }
    }
    let length = bytes.len().min(most);
    place[..length].copy_from_slice(&bytes[..length]);
    length
}
