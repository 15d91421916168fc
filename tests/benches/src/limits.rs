//! What the machine itself can do: floating-point operations and memory bandwidth of one core and of all.

use crate::cases::Row;
use std::hint::black_box;
use std::time::Instant;

/// Numbers in the arrays of the triad: far more than any cache holds.
const LARGE: usize = 1 << 24;
/// Numbers in registers.
const SMALL: usize = 64;

/// `a = a * b + c` with two roundings, as the kernels compute (no fused operations, so that all machines give the
/// same bits), on numbers that stay in registers.
#[inline(always)]
fn multiply_add(times: usize) -> f64 {
    let mut a = [0.0f64; SMALL];
    for (i, a) in a.iter_mut().enumerate() {
        *a = 1.0 + 1e-3 * i as f64;
    }
    let (b, c) = (black_box(0.999_999), black_box(1e-6));
    for _ in 0..times {
        for a in &mut a {
            *a = *a * b + c;
        }
    }
    a.iter().sum()
}

fn widest(times: usize) -> f64 {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx512f")]
        fn avx512(times: usize) -> f64 {
            multiply_add(times)
        }
        #[target_feature(enable = "avx2")]
        fn avx2(times: usize) -> f64 {
            multiply_add(times)
        }
        if std::arch::is_x86_feature_detected!("avx512f") {
            // SAFETY: AVX-512, all that it asks for, was found the line above.
            return unsafe { avx512(times) };
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: AVX2, all that it asks for, was found the line above.
            return unsafe { avx2(times) };
        }
    }
    multiply_add(times)
}

/// Nanoseconds for one multiplication and addition of the loop as any x86-64 or ARM has it: the least of some slices of milliseconds.
pub fn nanoseconds_per_operation() -> f64 {
    const TIMES: usize = 100_000;
    let slice = || {
        let clock = Instant::now();
        black_box(multiply_add(black_box(TIMES)));
        clock.elapsed().as_secs_f64()
    };
    let least = (0..20).map(|_| slice()).fold(f64::INFINITY, f64::min);
    1e9 * least / (TIMES * SMALL) as f64
}

/// Operations per second (1/s) of `threads` threads, the best of five.
fn operations(threads: usize) -> f64 {
    const TIMES: usize = 2_000_000;
    let once = || {
        let clock = Instant::now();
        std::thread::scope(|s| {
            for _ in 0..threads {
                s.spawn(|| black_box(widest(black_box(TIMES))));
            }
        });
        (threads * TIMES * SMALL * 2) as f64 / clock.elapsed().as_secs_f64()
    };
    (0..5).map(|_| once()).fold(0.0, f64::max)
}

/// Bytes per second that `a = b + s c` moves (two reads and a write of 8 bytes), the best of five.
fn triad(threads: usize) -> f64 {
    let (mut a, b, c) = (
        vec![0.0f64; LARGE],
        vec![1.0f64; LARGE],
        vec![2.0f64; LARGE],
    );
    let part = LARGE / threads;
    let mut once = || {
        let clock = Instant::now();
        std::thread::scope(|s| {
            for ((a, b), c) in a.chunks_mut(part).zip(b.chunks(part)).zip(c.chunks(part)) {
                s.spawn(move || {
                    for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
                        *a = b + 3.0 * c;
                    }
                });
            }
        });
        (24 * LARGE) as f64 / clock.elapsed().as_secs_f64()
    };
    let best = (0..5).map(|_| once()).fold(0.0, f64::max);
    black_box(&a);
    best
}

/// The machine's limits.
pub fn limits() -> Vec<Row> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let mut rows = Vec::new();
    for threads in if all > 1 { vec![1, all] } else { vec![1] } {
        rows.push(Row::new(
            format!("multiply and add in registers, {threads} threads"),
            1e-9 * operations(threads),
            "G operations/s",
        ));
        rows.push(Row::new(
            format!("triad of 400 MB, {threads} threads"),
            1e-9 * triad(threads),
            "GB/s",
        ));
    }
    rows
}
