//! Calls of several threads that really meet.
//!
//! A number of calls says little: on a busy machine each thread may have its turn alone, and what it keeps in a global is not disturbed.

use crate::Seen;
use std::sync::Barrier;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Whether two answers have the same bits.
pub(crate) fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Threads that call at once.
pub(crate) const THREADS: usize = 4;

/// Calls during which another one began, of all threads together, after which enough have met.
const MEETINGS: usize = 100;

/// How long to wait for that on a busy machine.
const PATIENCE: Duration = Duration::from_secs(2);

/// What came of it.
pub(crate) struct Met {
    /// Calls in all.
    pub(crate) calls: usize,
    /// Calls during which another one began.
    pub(crate) meetings: usize,
    /// Calls with another answer than that of one thread alone.
    pub(crate) differing: usize,
}

impl Met {
    /// The verdict: none may differ.
    pub(crate) fn seen(&self) -> Seen {
        Seen::Number {
            measured: self.differing as f64,
            limit: 0.0,
            what: self.told(),
        }
    }

    /// In words: of a sound plugin the same every time, unless the machine was too busy for calls to meet.
    pub(crate) fn told(&self) -> String {
        let differing = self.differing;
        if differing > 0 {
            // One that differs is enough, however few have met until then.
            format!("{THREADS} threads at once: {differing} calls differ")
        } else if self.meetings >= MEETINGS {
            format!(
                "{THREADS} threads, {MEETINGS} calls and more while another began: none differs"
            )
        } else {
            format!(
                "{THREADS} threads, {} calls, but only {} while another began (the machine is busy): none differs",
                self.calls, self.meetings
            )
        }
    }
}

/// Counts the calls of all threads.
pub(crate) struct Counter<'a> {
    begun: &'a AtomicUsize,
    met: &'a AtomicUsize,
}

impl Counter<'_> {
    /// Makes a call and notes whether another began during it.
    #[inline]
    pub(crate) fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        let before = self.begun.fetch_add(1, Ordering::SeqCst) + 1;
        let answer = call();
        if self.begun.load(Ordering::SeqCst) != before {
            self.met.fetch_add(1, Ordering::Relaxed);
        }
        answer
    }
}

/// Lets every thread run `work` over and over (its number, and what its calls go through; it gives how many calls it made and how many
/// answers differed) until enough calls have met.
pub(crate) fn meet(work: impl Fn(usize, &Counter<'_>) -> (usize, usize) + Sync) -> Met {
    let (begun, met) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let counter = Counter {
        begun: &begun,
        met: &met,
    };
    let (start, clock) = (Barrier::new(THREADS), Instant::now());
    let of_thread = |thread: usize| {
        start.wait();
        let (mut calls, mut differing) = (0, 0);
        loop {
            let (made, differ) = work(thread, &counter);
            calls += made;
            differing += differ;
            // One that differs is enough.
            let found = differing > 0;
            if found || met.load(Ordering::Relaxed) >= MEETINGS || clock.elapsed() > PATIENCE {
                return (calls, differing);
            }
        }
    };
    let sums: Vec<(usize, usize)> = std::thread::scope(|scope| {
        let of_thread = &of_thread;
        let workers: Vec<_> = (0..THREADS)
            .map(|t| scope.spawn(move || of_thread(t)))
            .collect();
        // A thread that panicked has no answer.
        workers
            .into_iter()
            .map(|w| w.join().unwrap_or((1, 1)))
            .collect()
    });
    Met {
        calls: sums.iter().map(|s| s.0).sum(),
        meetings: met.into_inner(),
        differing: sums.iter().map(|s| s.1).sum(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_threads_share_is_found_out_and_what_they_do_not_is_left_alone() {
        static SHARED: AtomicUsize = AtomicUsize::new(0);
        // Writes its number, does something for a while, and reads it back: as scratch memory in a global is used.
        let scratch = |thread: usize, counter: &Counter<'_>| {
            let different = (0..100).filter(|k| {
                let own = 1000 * thread + k;
                let read = counter.during(|| {
                    SHARED.store(own, Ordering::Relaxed);
                    let work = (0..2000u64).fold(0u64, |s, i| std::hint::black_box(s ^ i));
                    std::hint::black_box(work);
                    SHARED.load(Ordering::Relaxed)
                });
                read != own
            });
            (100, different.count())
        };
        let met = meet(scratch);
        assert!(met.meetings > 0 && met.differing > 0, "{}", met.told());
        assert!(met.calls >= THREADS * 100);

        let sound = |_: usize, counter: &Counter<'_>| {
            let own = |k: &usize| counter.during(|| std::hint::black_box(*k)) != *k;
            (100, (0..100).filter(own).count())
        };
        assert_eq!(meet(sound).differing, 0);
    }
}
