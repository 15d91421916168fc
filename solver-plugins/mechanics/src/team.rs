//! Threads that stay awake between the pieces of parallel work of a step.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// How long a thread looks for work without a pause. A step has three or four pieces of parallel work with some microseconds
/// to some tens of them between; a thread of the pool that has gone to sleep in between takes some 25 microseconds to
/// wake, a tenth of a piece in a small bag.
const PATIENCE: Duration = Duration::from_micros(40);

/// Pause between two looks of a thread that has lost its patience: while a file is written, or one thread builds something.
const PAUSE: Duration = Duration::from_micros(50);

/// Looks between two looks at the clock.
const LOOKS: u32 = 16;

/// Ends the threads' waiting however the work ends.
struct Done(Arc<AtomicBool>);

impl Drop for Done {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Does `work` with the other threads of the present pool kept awake. What they do there, and in which order, is as without.
/// To be called from a thread of a pool that does nothing else; elsewhere it only does `work`.
pub fn awake<R>(work: impl FnOnce() -> R) -> R {
    let (threads, Some(own)) = (rayon::current_num_threads(), rayon::current_thread_index()) else {
        return work();
    };
    if threads == 1 {
        return work();
    }
    let done = Done(Arc::default());
    let begun = Arc::new(AtomicUsize::new(1));
    let (is_done, has_begun) = (done.0.clone(), begun.clone());
    rayon::spawn_broadcast(move |thread| {
        if thread.index() != own {
            has_begun.fetch_add(1, Ordering::Release);
            look_for_work(&is_done);
        }
    });
    // One that begins later could do so while it waits within a piece of work, and would never go back to it.
    while begun.load(Ordering::Acquire) < threads {
        std::thread::yield_now();
    }
    work()
}

/// Takes part in what the pool does until all is done.
fn look_for_work(is_done: &AtomicBool) {
    let (mut since, mut looks) = (Instant::now(), 0);
    while !is_done.load(Ordering::Acquire) {
        if rayon::yield_now() == Some(rayon::Yield::Executed) {
            (since, looks) = (Instant::now(), 0);
            continue;
        }
        looks += 1;
        if looks < LOOKS {
            std::hint::spin_loop();
        } else {
            looks = 0;
            if since.elapsed() > PATIENCE {
                std::thread::sleep(PAUSE);
            } else {
                // Where others want the processor, the thread that looks for work must not keep the one that has it from it.
                std::thread::yield_now();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    /// In a pool of `threads` of its own, whose end waits for all of them.
    fn in_pool<R: Send>(threads: usize, f: impl FnOnce() -> R + Send) -> R {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().expect("a pool").install(f)
    }

    /// Many short pieces of parallel work, one within the other, and pauses that outlast the threads' patience.
    fn work() -> u64 {
        let mut sum = 0;
        for round in 0..200u64 {
            let part = || {
                (0..64u32)
                    .into_par_iter()
                    .with_max_len(1)
                    .map(|i| u64::from(i) * round)
            };
            let (a, b) = rayon::join(|| part().sum::<u64>(), || part().max().unwrap_or(0));
            sum += a + b;
            if round % 50 == 0 {
                std::thread::sleep(2 * PATIENCE);
            }
        }
        sum
    }

    #[test]
    fn work_is_done_by_any_number_of_threads_and_they_end_with_it() {
        let expected: u64 = (0..200).map(|round| round * (2016 + 63)).sum();
        for threads in 1..=4 {
            let sums = in_pool(threads, || [awake(work), awake(work)]);
            assert_eq!(sums, [expected; 2], "{threads} threads");
        }
        assert_eq!(awake(|| 7), 7, "outside of a pool");
    }

    #[test]
    fn threads_end_when_the_work_panics() {
        let ended = in_pool(3, || {
            std::panic::catch_unwind(|| awake(|| panic!("in the midst of it"))).is_err()
        });
        assert!(ended);
    }

    #[test]
    fn the_other_threads_take_part() {
        let seen = in_pool(2, || {
            awake(|| {
                let late = Instant::now() + Duration::from_secs(20);
                let other = AtomicBool::new(false);
                // Each waits for the other: neither could do both.
                rayon::join(
                    || {
                        while !other.load(Ordering::Acquire) && Instant::now() < late {
                            std::hint::spin_loop();
                        }
                    },
                    || other.store(true, Ordering::Release),
                );
                Instant::now() < late
            })
        });
        assert!(seen);
    }
}
