//! Calls of several threads that really meet.
//!
//! A number of calls says little: on a busy machine each thread may have its turn alone, and what it keeps in a global is not disturbed.
//! Calls at once say little, too: a core reads what it wrote from its own store buffer, whatever the others have written there
//! since, and scratch memory of 400 bytes in a global went through a quarter of all checks. So calls are paused in their midst.

use crate::breaches::Ask;
use crate::run::Seen;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU32, AtomicUsize, Ordering, compiler_fence};
use std::sync::{Barrier, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Whether two answers have the same bits.
pub(crate) fn same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Calls of a thread between two looks at whether enough have met.
pub(crate) const CALLS: usize = 500;

/// Threads that call at once: where calls are paused more would only wait for a core.
const THREADS: usize = 2;

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
    /// How often a thread was paused.
    pub(crate) pauses: usize,
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
        } else if self.pauses == 0 {
            format!(
                "{THREADS} threads, {} calls, none of them paused (the system gives no timer or keeps its signal back): none differs",
                self.calls
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
const SIGNAL: libc::c_int = libc::SIGURG;

/// Time from the end of a pause to the next, and what each further thread has more, so that they are not paused together.
const EVERY: Duration = Duration::from_micros(30);
const FURTHER: Duration = Duration::from_micros(7);

/// How long a pause is at most where the others have cores of their own, in looks for their calls (some 20 microseconds), ...
const LOOKS: usize = 500;

/// ... and then, for the thread to leave its core to another.
const SLEEP: libc::timespec = libc::timespec {
    tv_sec: 0,
    tv_nsec: 20_000,
};

thread_local! {
    /// How often this thread was paused.
    static PAUSED: AtomicUsize = const { AtomicUsize::new(0) };
    /// How this thread is paused; null where it is not.
    static OWN: AtomicPtr<Pauses> = const { AtomicPtr::new(std::ptr::null_mut()) };
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

/// What the handler needs.
struct Pauses {
    timer: libc::timer_t,
    every: Duration,
    /// Calls that have begun, of all threads.
    begun: *const AtomicUsize,
    /// As many as had begun at the end of the last pause.
    seen: AtomicUsize,
    /// By how much longer than `every` the next pause waits, in powers of two.
    longer: AtomicU32,
}

impl Pauses {
    /// Sets the timer for one pause: one that went on by itself would leave no time between pauses that are longer than it.
    /// Async-signal-safe.
    ///
    /// # Safety
    /// The timer was made and not deleted.
    unsafe fn set(&self) {
        // SAFETY: numbers alone, for which zeros are values.
        let mut times: libc::itimerspec = unsafe { std::mem::zeroed() };
        let longer = self.longer.load(Ordering::Relaxed);
        times.it_value.tv_nsec = i64::from(self.every.subsec_nanos()) << longer;
        // SAFETY: a timer that is there (the caller's promise), whole times, and NULL for those before.
        unsafe { libc::timer_settime(self.timer, 0, &raw const times, std::ptr::null_mut()) };
    }
}

/// The handler that was there before, where it takes information with the signal; 0 where there was none such.
static BEFORE: AtomicUsize = AtomicUsize::new(0);

/// Pauses the thread that the signal came to, wherever it is, until another has made a call, or had the time for it. What no timer sent goes
/// to the handler that was there before: a plugin's runtime may use the signal between its own threads.
extern "C" fn pause(signal: libc::c_int, info: *mut libc::siginfo_t, context: *mut libc::c_void) {
    // SAFETY: the system gives the information.
    if unsafe { (*info).si_code } != libc::SI_TIMER {
        let before = BEFORE.load(Ordering::Relaxed);
        if before > libc::SIG_IGN {
            type Handler = extern "C" fn(libc::c_int, *mut libc::siginfo_t, *mut libc::c_void);
            // SAFETY: it was installed with SA_SIGINFO.
            let before = unsafe { std::mem::transmute::<usize, Handler>(before) };
            before(signal, info, context);
        }
        return;
    }
    // SAFETY: what it points to outlives the thread's timer, and it is null before and after.
    let Some(own) = (unsafe { OWN.with(|p| p.load(Ordering::Relaxed)).as_ref() }) else {
        return;
    };
    // SAFETY: as above.
    let begun = unsafe { &*own.begun };
    PAUSED.with(|p| p.fetch_add(1, Ordering::Relaxed));
    let first = begun.load(Ordering::SeqCst);
    // With the second call that begins the one before has ended.
    let met = || begun.load(Ordering::SeqCst) > first + 1;
    let alone = (0..LOOKS).all(|_| {
        std::hint::spin_loop();
        !met()
    });
    // SAFETY: all that is called here is async-signal-safe; what it interrupts finds `errno` as it was.
    unsafe {
        let errno = *libc::__errno_location();
        if alone {
            let time = SLEEP;
            libc::nanosleep(&raw const time, std::ptr::null_mut());
        }
        // Where no call has begun since the last pause, signals come faster than the machine works: it gets more time, up to 8 ms.
        let now = begun.load(Ordering::SeqCst);
        let longer = own.longer.load(Ordering::Relaxed);
        if own.seen.swap(now, Ordering::Relaxed) == now {
            own.longer.store((longer + 1).min(8), Ordering::Relaxed);
        }
        own.set();
        *libc::__errno_location() = errno;
    }
}

/// Lets the signal pause threads until it is dropped. Where that cannot be, nothing is paused, and the check says so.
struct Handling;

/// How many [`Handling`] there are, and what the signal did before the first.
static HANDLING: Mutex<(usize, Option<libc::sigaction>)> = Mutex::new((0, None));

impl Handling {
    fn begin() -> Self {
        let mut all = HANDLING.lock().unwrap_or_else(PoisonError::into_inner);
        if all.0 == 0 {
            // SAFETY: an action of zeros is one without flags and mask; the handler is a function that stays. It runs on a stack of its own where the
            // thread has one: runtimes with small stacks ask for that.
            unsafe {
                let mut action: libc::sigaction = std::mem::zeroed();
                let mut before: libc::sigaction = std::mem::zeroed();
                action.sa_sigaction = pause as *const () as libc::sighandler_t;
                action.sa_flags = libc::SA_RESTART | libc::SA_ONSTACK | libc::SA_SIGINFO;
                if libc::sigaction(SIGNAL, std::ptr::null(), &raw mut before) == 0 {
                    let takes_more = before.sa_flags & libc::SA_SIGINFO != 0;
                    let handler = if takes_more { before.sa_sigaction } else { 0 };
                    BEFORE.store(handler, Ordering::Relaxed);
                    if libc::sigaction(SIGNAL, &raw const action, std::ptr::null_mut()) == 0 {
                        all.1 = Some(before);
                    }
                }
            }
        }
        all.0 += 1;
        Self
    }
}

impl Drop for Handling {
    fn drop(&mut self) {
        let mut all = HANDLING.lock().unwrap_or_else(PoisonError::into_inner);
        all.0 -= 1;
        if all.0 == 0
            && let Some(before) = all.1.take()
        {
            // SAFETY: as it was.
            unsafe { libc::sigaction(SIGNAL, &raw const before, std::ptr::null_mut()) };
        }
    }
}

/// Pauses the thread that made it, over and over, until it is dropped. The kernel's timer needs no thread and no core of its own.
struct Pausing<'a> {
    /// Where it stays, for the handler; none if the system has no such timer.
    pauses: Option<Box<Pauses>>,
    begun: PhantomData<&'a AtomicUsize>,
}

impl<'a> Pausing<'a> {
    fn begin(thread: usize, begun: &'a AtomicUsize) -> Self {
        // The first use of a thread's variables may allocate, which a handler must not.
        let _ = pauses();
        // SAFETY: all that is pointed to is whole and lives through the call; an event of zeros is one without fields.
        let (made, timer) = unsafe {
            let mut event: libc::sigevent = std::mem::zeroed();
            event.sigev_notify = libc::SIGEV_THREAD_ID;
            event.sigev_signo = SIGNAL;
            event.sigev_notify_thread_id = libc::gettid();
            let mut timer: libc::timer_t = std::ptr::null_mut();
            let code = libc::timer_create(libc::CLOCK_MONOTONIC, &raw mut event, &raw mut timer);
            (code == 0, timer)
        };
        let pauses = made.then(|| {
            Box::new(Pauses {
                timer,
                every: EVERY + FURTHER * thread as u32,
                begun,
                seen: AtomicUsize::new(0),
                longer: AtomicU32::new(0),
            })
        });
        if let Some(pauses) = &pauses {
            let own = std::ptr::from_ref::<Pauses>(pauses).cast_mut();
            OWN.with(|p| p.store(own, Ordering::Relaxed));
            // SAFETY: just made.
            unsafe { pauses.set() };
        }
        Self {
            pauses,
            begun: PhantomData,
        }
    }
}

impl Drop for Pausing<'_> {
    fn drop(&mut self) {
        // A signal that is still on its way pauses nothing and sets no timer.
        OWN.with(|p| p.store(std::ptr::null_mut(), Ordering::Relaxed));
        compiler_fence(Ordering::SeqCst);
        if let Some(pauses) = &self.pauses {
            // SAFETY: made by `begin`, deleted once.
            unsafe { libc::timer_delete(pauses.timer) };
        }
    }
}

/// Lets every thread make its own call over and over, with and without the optional outputs in turn: whether all get what one
/// thread alone gets. `start`: what the call of a thread begins with; `alone`: what it gives; `hammer`: of [`CALLS`] calls, how
/// many differ from that.
pub(crate) fn judge<S: Sync, A: Sync>(
    start: impl Fn(usize) -> S,
    alone: impl Fn(&S, Ask) -> A,
    hammer: impl Fn(&S, Ask, &A, &Counter<'_>) -> usize + Sync,
) -> Seen {
    let threads = (0..THREADS).map(|t| {
        let start = start(t);
        let answers = Ask::HAMMERED.map(|ask| alone(&start, ask));
        (start, answers)
    });
    let threads: Vec<_> = threads.collect();
    let met = meet_in_turn(Ask::HAMMERED.len(), |kind, thread, counter| {
        let (start, answers) = &threads[thread];
        let (ask, want) = (Ask::HAMMERED[kind], &answers[kind]);
        (CALLS, hammer(start, ask, want, counter))
    });
    met.seen()
}

/// Lets calls meet ([`meet`]) once for each of several `kinds` of them, by number, until some differ; what came of the worst.
fn meet_in_turn(
    kinds: usize,
    work: impl Fn(usize, usize, &Counter<'_>) -> (usize, usize) + Sync,
) -> Met {
    let mut worst: Option<Met> = None;
    for kind in 0..kinds {
        let met = meet(|thread, counter| work(kind, thread, counter));
        if met.differing > 0 {
            return met;
        }
        if worst.as_ref().is_none_or(|w| met.meetings < w.meetings) {
            worst = Some(met);
        }
    }
    worst.expect("at least one kind of calls")
}

/// Lets every thread run `work` over and over (its number, and what its calls go through; it gives how many calls it made and how many
/// answers differed), paused in its midst now and then, until enough calls have met.
fn meet(work: impl Fn(usize, &Counter<'_>) -> (usize, usize) + Sync) -> Met {
    let (begun, met) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let over = AtomicBool::new(false);
    let counter = Counter {
        begun: &begun,
        met: &met,
    };
    let (start, clock) = (Barrier::new(THREADS), Instant::now());
    let _handling = Handling::begin();
    let of_thread = |thread: usize| {
        start.wait();
        let pausing = Pausing::begin(thread, &begun);
        let (mut calls, mut differing) = (0, 0);
        loop {
            let (made, differ) = work(thread, &counter);
            calls += made;
            differing += differ;
            // One that differs is enough. Whoever sees the end ends all: alone a thread meets nobody.
            let found = differing > 0;
            if found || met.load(Ordering::Relaxed) >= MEETINGS || clock.elapsed() > PATIENCE {
                over.store(true, Ordering::Relaxed);
            }
            if over.load(Ordering::Relaxed) {
                drop(pausing);
                return (calls, differing, pauses());
            }
        }
    };
    let sums: Vec<(usize, usize, usize)> = std::thread::scope(|scope| {
        let of_thread = &of_thread;
        let workers: Vec<_> = (0..THREADS)
            .map(|t| scope.spawn(move || of_thread(t)))
            .collect();
        // A thread that panicked has no answer.
        workers
            .into_iter()
            .map(|w| w.join().unwrap_or((1, 1, 0)))
            .collect()
    });
    Met {
        calls: sums.iter().map(|s| s.0).sum(),
        meetings: met.into_inner(),
        differing: sums.iter().map(|s| s.1).sum(),
        pauses: sums.iter().map(|s| s.2).sum(),
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
