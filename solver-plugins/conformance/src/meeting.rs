//! Calls of several threads that really meet.
//!
//! A number of calls says little: on a busy machine each thread may have its turn alone, and what it keeps in a global is not disturbed.
//! Calls at once say little, too: a core reads what it wrote from its own store buffer, whatever the others have written there
//! since, and scratch memory of 400 bytes in a global went through a quarter of all checks. So calls are paused in their midst.

use crate::Seen;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering, compiler_fence};
use std::sync::{Barrier, Once, mpsc};
use std::time::{Duration, Instant};

/// Whether two answers have the same bits.
pub(crate) fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Threads that call at once: where calls are paused more would only wait for a core.
pub(crate) const THREADS: usize = 2;

/// Calls that were paused while another one began, of all threads together, after which enough have met: what a call keeps in a
/// global for a hundredth of its time is disturbed in 98 of 100 checks, for a tenth practically always.
const MEETINGS: usize = 400;

/// How long to wait for that on a busy machine.
const PATIENCE: Duration = Duration::from_secs(2);

/// What came of it.
pub(crate) struct Met {
    /// Calls in all.
    pub(crate) calls: usize,
    /// Calls that were paused while another one began.
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
                "{THREADS} threads, {MEETINGS} calls and more paused while another began: none differs"
            )
        } else {
            format!(
                "{THREADS} threads, {} calls, but only {} paused while another began (the machine is busy): none differs",
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
    /// Makes a call and notes whether it was paused and another began meanwhile.
    #[inline]
    pub(crate) fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        let pauses = pauses();
        let before = self.begun.fetch_add(1, Ordering::SeqCst) + 1;
        let answer = call();
        if self::pauses() != pauses && self.begun.load(Ordering::SeqCst) != before {
            self.met.fetch_add(1, Ordering::Relaxed);
        }
        answer
    }
}

/// The signal that pauses a thread: one that is ignored where nobody asks for it, as runtimes with preemption take it, too.
const PAUSES: libc::c_int = libc::SIGURG;

/// How long a thread is paused, and how long after that the next one: time for calls of the others.
const PAUSE: Duration = Duration::from_micros(20);

thread_local! {
    /// How often this thread was paused.
    static PAUSED: AtomicUsize = const { AtomicUsize::new(0) };
}

/// How often this thread was paused.
#[inline]
fn pauses() -> usize {
    // The handler runs in this thread: the compiler must not move the calls it interrupts across this.
    compiler_fence(Ordering::SeqCst);
    let count = PAUSED.with(|p| p.load(Ordering::Relaxed));
    compiler_fence(Ordering::SeqCst);
    count
}

/// Pauses the thread that the signal came to, wherever it is. It calls what a handler may, and leaves `errno` as it was.
extern "C" fn pause(_: libc::c_int) {
    let time = libc::timespec {
        tv_sec: 0,
        tv_nsec: i64::from(PAUSE.subsec_nanos()),
    };
    PAUSED.with(|p| p.fetch_add(1, Ordering::Relaxed));
    // SAFETY: both are async-signal-safe, and `time` is whole.
    unsafe {
        let errno = *libc::__errno_location();
        libc::nanosleep(&raw const time, std::ptr::null_mut());
        *libc::__errno_location() = errno;
    }
}

/// Lets the signal pause threads, from here on in this process. Where that cannot be, nothing is paused, and the check says so.
fn let_pause() {
    static ONCE: Once = Once::new();
    // SAFETY: an action of zeros is one without flags and mask; the handler is a function that stays.
    ONCE.call_once(|| unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = pause as extern "C" fn(libc::c_int) as libc::sighandler_t;
        action.sa_flags = libc::SA_RESTART;
        libc::sigaction(PAUSES, &raw const action, std::ptr::null_mut());
    });
}

/// Lets every thread run `work` over and over (its number, and what its calls go through; it gives how many calls it made and how many
/// answers differed) and pauses one after the other in its midst, until enough calls have met.
pub(crate) fn meet(work: impl Fn(usize, &Counter<'_>) -> (usize, usize) + Sync) -> Met {
    let_pause();
    let (begun, met, over) = (
        AtomicUsize::new(0),
        AtomicUsize::new(0),
        AtomicBool::new(false),
    );
    let counter = Counter {
        begun: &begun,
        met: &met,
    };
    let start = Barrier::new(THREADS);
    let of_thread = |thread: usize, own: mpsc::Sender<libc::pthread_t>| {
        // The first use of a thread's variables may allocate, which a handler must not.
        let _ = pauses();
        // SAFETY: asks for the calling thread.
        let _ = own.send(unsafe { libc::pthread_self() });
        start.wait();
        let (mut calls, mut differing) = (0, 0);
        loop {
            let (made, differ) = work(thread, &counter);
            calls += made;
            differing += differ;
            if differ > 0 {
                // One that differs is enough.
                over.store(true, Ordering::Relaxed);
            }
            if over.load(Ordering::Relaxed) {
                return (calls, differing);
            }
        }
    };
    let sums: Vec<(usize, usize)> = std::thread::scope(|scope| {
        let of_thread = &of_thread;
        let (own, threads) = mpsc::channel();
        let workers: Vec<_> = (0..THREADS)
            .map(|t| {
                let own = own.clone();
                scope.spawn(move || of_thread(t, own))
            })
            .collect();
        let threads: Vec<libc::pthread_t> = threads.iter().take(THREADS).collect();
        let clock = Instant::now();
        for thread in threads.iter().cycle() {
            let enough = met.load(Ordering::Relaxed) >= MEETINGS || clock.elapsed() > PATIENCE;
            // One that panicked no longer calls; its handle keeps the thread's name valid.
            if enough
                || workers
                    .iter()
                    .any(std::thread::ScopedJoinHandle::is_finished)
            {
                over.store(true, Ordering::Relaxed);
            }
            if over.load(Ordering::Relaxed) {
                break;
            }
            // SAFETY: the thread is not joined before the workers are, below.
            unsafe { libc::pthread_kill(*thread, PAUSES) };
            std::thread::sleep(PAUSE);
        }
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
        assert!(met.differing > 0, "{}", met.told());
        assert!(met.calls >= THREADS * 100);

        // So little and so soon that a core reads it from its own store buffer, whoever has written there since.
        static SMALL: [AtomicUsize; 8] = [const { AtomicUsize::new(0) }; 8];
        let short = |thread: usize, counter: &Counter<'_>| {
            let different = (0..100).filter(|k| {
                let own = 1000 * thread + k;
                counter.during(|| {
                    SMALL.iter().for_each(|s| s.store(own, Ordering::Relaxed));
                    std::hint::black_box((0..50).fold(0, |s, i| std::hint::black_box(s ^ i)));
                    SMALL.iter().any(|s| s.load(Ordering::Relaxed) != own)
                })
            });
            (100, different.count())
        };
        let met = meet(short);
        assert!(met.differing > 0, "{}", met.told());

        let sound = |_: usize, counter: &Counter<'_>| {
            let own = |k: &usize| counter.during(|| std::hint::black_box(*k)) != *k;
            (100, (0..100).filter(own).count())
        };
        let met = meet(sound);
        assert_eq!(met.differing, 0);
        assert!(met.meetings > 0, "{}", met.told());
    }
}
