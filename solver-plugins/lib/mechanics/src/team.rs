//! Threads that stay awake between the pieces of parallel work of a step, and steps that one thread does while the others have no processor.
//!
//! Threads that share a step wait for each other some times in it. Alone on the machine that costs microseconds. Where others want the
//! processors too, a thread may be off them for milliseconds in the midst of its piece, and each who waits for it gives away time of its
//! own (`docs/decisions/0041`). So [`Sharing`] measures: when steps take longer than they have taken, it tries whether one thread by
//! itself is faster, and goes on with what is. Results do not depend on it.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// How long a thread looks for work without a pause. A step has three or four pieces of parallel work with some microseconds
/// to some tens of them between; a thread of the pool that has gone to sleep in between takes some 25 microseconds to
/// wake, a tenth of a piece in a small bag.
const PATIENCE: Duration = Duration::from_micros(40);

/// Pause between two looks of a thread that has lost its patience: while a file is written, or one thread builds something. It doubles from
/// look to look up to the longest: while one thread does the steps by itself, the others are to leave it the processor.
const PAUSE: Duration = Duration::from_micros(50);
/// The longest pause.
const LONGEST_PAUSE: Duration = Duration::from_millis(1);

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
    let (mut since, mut looks, mut pause) = (Instant::now(), 0, PAUSE);
    while !is_done.load(Ordering::Acquire) {
        if rayon::yield_now() == Some(rayon::Yield::Executed) {
            (since, looks, pause) = (Instant::now(), 0, PAUSE);
            continue;
        }
        looks += 1;
        // No yielding to others: a scheduler may take a whole slice of some milliseconds for it.
        std::hint::spin_loop();
        if looks == LOOKS {
            looks = 0;
            if since.elapsed() > PATIENCE {
                std::thread::sleep(pause);
                pause = (2 * pause).min(LONGEST_PAUSE);
            }
        }
    }
}

thread_local! {
    /// Whether this thread does the present step by itself.
    static ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Whether the present thread does the work of a step by itself: it has no others, or they have no processor.
pub(crate) fn is_alone() -> bool {
    ALONE.get() || rayon::current_num_threads() == 1
}

/// For `with_min_len` of parallel iterators: the fewest items that a thread takes, all of them in work that it does by itself.
pub(crate) fn least() -> usize {
    if ALONE.get() { usize::MAX } else { 1 }
}

/// `rayon::join`, or one after the other in work that the present thread does by itself.
pub(crate) fn join<A: Send, B: Send>(
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if ALONE.get() {
        (a(), b())
    } else {
        rayon::join(a, b)
    }
}

/// Steps that are measured together, and how long they take at least.
const WINDOW_STEPS: u32 = 16;
const WINDOW: Duration = Duration::from_millis(20);
/// Steps this much slower than the fastest are a sign that others want the processors.
const SLOWED: f64 = 1.3;
/// How fast the fastest is forgotten, by window: a step becomes dearer in the course of a run.
const FORGET: f64 = 1.002;
/// Windows before the other way is tried again after it was found slower, at first and at most.
const FIRST_WAIT: u32 = 8;
const LONGEST_WAIT: u32 = 128;
/// A window that is so much faster or slower than the one before says that others have come or gone.
const CHANGED: f64 = 0.8;
/// The other way must be faster by this, or threads would go to and fro on nothing.
const BETTER: f64 = 0.95;

/// Who does the steps of a model: all threads of the pool, or the one that runs them. Decided by the time that they take.
#[derive(Debug)]
pub(crate) struct Sharing {
    is_alone: bool,
    /// Whether the present window tries the way that is not the present one.
    is_trial: bool,
    /// Steps and time (s) of the present window so far.
    steps: u32,
    spent: f64,
    /// Time of a step in the last window of the present way (s).
    usual: f64,
    /// That of the fastest window in which all threads shared the steps (s).
    fastest: f64,
    /// Windows until the next trial, and after that one if it is lost.
    wait: u32,
    next_wait: u32,
}

impl Default for Sharing {
    fn default() -> Self {
        Self {
            is_alone: false,
            is_trial: false,
            steps: 0,
            spent: 0.0,
            usual: 0.0,
            fastest: f64::INFINITY,
            wait: 1,
            next_wait: FIRST_WAIT,
        }
    }
}

impl Sharing {
    /// Does a step in the way that is chosen, and measures it.
    pub(crate) fn during<R>(&mut self, step: impl FnOnce() -> R) -> R {
        if rayon::current_num_threads() == 1 || rayon::current_thread_index().is_none() {
            return step();
        }
        let begin = Instant::now();
        ALONE.set(self.is_alone != self.is_trial);
        let done = step();
        ALONE.set(false);
        self.count(begin.elapsed().as_secs_f64());
        done
    }

    /// Counts a step of so many seconds.
    fn count(&mut self, seconds: f64) {
        self.steps += 1;
        self.spent += seconds;
        if self.steps < WINDOW_STEPS || self.spent < WINDOW.as_secs_f64() {
            return;
        }
        let each = self.spent / f64::from(self.steps);
        (self.steps, self.spent) = (0, 0.0);
        if self.is_alone == self.is_trial {
            self.fastest = each.min(self.fastest * FORGET);
        }
        if self.is_trial {
            self.is_trial = false;
            if each < BETTER * self.usual {
                self.is_alone = !self.is_alone;
                self.usual = each;
                (self.wait, self.next_wait) = (FIRST_WAIT, FIRST_WAIT);
            } else {
                self.wait = self.next_wait;
                self.next_wait = (2 * self.next_wait).min(LONGEST_WAIT);
            }
            return;
        }
        // Others have come or gone: what was found before says nothing any more.
        if each < CHANGED * self.usual || self.usual < CHANGED * each {
            (self.wait, self.next_wait) = (self.wait.min(1), FIRST_WAIT);
        }
        self.usual = each;
        // All threads together need no trial while they are as fast as ever; one by itself always asks for the others.
        let is_slow = self.is_alone || each > SLOWED * self.fastest;
        if !is_slow {
            (self.wait, self.next_wait) = (1, FIRST_WAIT);
        } else if self.wait > 1 {
            self.wait -= 1;
        } else {
            self.is_trial = true;
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

    /// Counts windows of steps of so many seconds, shared or alone, and gives how many of them were alone.
    fn windows(s: &mut Sharing, n: usize, shared: f64, alone: f64) -> usize {
        let mut of_one = 0;
        for _ in 0..n {
            let is_alone = s.is_alone != s.is_trial;
            of_one += usize::from(is_alone);
            for _ in 0..WINDOW_STEPS {
                s.count(if is_alone { alone } else { shared });
            }
        }
        of_one
    }

    #[test]
    fn one_thread_takes_over_where_others_want_the_processors_and_gives_back_when_they_leave() {
        let mut s = Sharing::default();
        assert_eq!(windows(&mut s, 100, 0.01, 0.018), 0, "nothing else runs");
        // Others come: two threads wait for each other.
        assert!(windows(&mut s, 100, 0.06, 0.03) > 80);
        // They leave.
        assert!(windows(&mut s, 300, 0.01, 0.018) < 30);
        assert!(windows(&mut s, 100, 0.01, 0.018) == 0);
        // Others come, but two are faster still: one is tried rarely.
        assert!(windows(&mut s, 500, 0.02, 0.03) < 15);
    }

    #[test]
    fn steps_that_become_dearer_are_no_sign_of_others() {
        let mut s = Sharing::default();
        let alone: usize = (0..1000)
            .map(|i| {
                let step = 0.01 * (1.0 + f64::from(i) / 1000.0);
                windows(&mut s, 1, step, 1.8 * step)
            })
            .sum();
        assert_eq!(alone, 0);
    }

    #[test]
    fn work_of_one_thread_by_itself_is_not_split() {
        in_pool(2, || {
            awake(|| {
                ALONE.set(true);
                let own = std::thread::current().id();
                let all = (0..1000)
                    .into_par_iter()
                    .with_max_len(1)
                    .with_min_len(least());
                assert!(all.map(|_| std::thread::current().id()).all(|id| id == own));
                ALONE.set(false);
            });
        });
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
