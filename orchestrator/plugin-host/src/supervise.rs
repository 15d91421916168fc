//! A step's children die with it.
//!
//! A plugin may start processes, which may leave their group and session (`setsid`) and their parent (a second fork).
//! They are reached through the one thing that they cannot leave: when their parent dies, the kernel gives them to the
//! nearest ancestor that has asked for orphans (a *subreaper*). So every worker is two processes: a supervisor, which
//! runs no code of plugins, and the worker in it. The supervisor ends when the worker or the engine does, however that
//! dies, and takes all that is below it along. If the supervisor itself is killed, the engine, a subreaper too, does the
//! same ([`Orphans`]).

use std::ffi::{c_char, c_int};
use std::sync::atomic::{AtomicBool, Ordering};

/// Runs `work` in a child of this process and ends this process as the child ended, after everything below it.
///
/// The child calls `inside` first; it dies when this process does.
///
/// # Safety
/// This process has one thread: a child has no other, and locks that others held would never be let go in it.
pub unsafe fn supervise(inside: impl FnOnce(), work: impl FnOnce() -> i32) -> ! {
    // SAFETY: `fork` in a process of one thread (the caller's promise), so that the child may do all that this process may. The other calls of the
    // system take numbers, a set of signals that `hear` has made, and NULL for what is not wanted.
    unsafe {
        libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 1 as libc::c_ulong);
        let heard = hear();
        let engine = libc::getppid();
        let me = libc::getpid();
        // Whoever started this process is followed from now on by a signal that can be answered.
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGUSR2 as libc::c_ulong);
        if libc::getppid() != engine {
            libc::_exit(2);
        }
        let worker = libc::fork();
        if worker == 0 {
            libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 0 as libc::c_ulong);
            libc::sigprocmask(libc::SIG_UNBLOCK, &raw const heard, std::ptr::null_mut());
            libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL as libc::c_ulong);
            if libc::getppid() != me {
                libc::_exit(2);
            }
            inside();
            libc::_exit(work());
        }
        if worker < 0 {
            // No second process is to be had: the step is more important than what it might leave behind.
            libc::sigprocmask(libc::SIG_UNBLOCK, &raw const heard, std::ptr::null_mut());
            libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL as libc::c_ulong);
            libc::_exit(work());
        }
        let status = attend(&heard, worker, engine);
        // Mostly there is nothing left, and to hear that costs less than to look.
        if libc::waitpid(-1, std::ptr::null_mut(), libc::WNOHANG) >= 0 {
            end_all(&[]);
        }
        end_as(status)
    }
}

/// Blocks the signals that a supervisor waits for.
fn hear() -> libc::sigset_t {
    // SAFETY: a set of signals is plain bits, for which zeros are a value; the calls get a whole one of this function, numbers of signals, and
    // NULL for what is not wanted.
    unsafe {
        let mut set: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut set);
        for signal in [
            libc::SIGCHLD,
            libc::SIGUSR2,
            libc::SIGTERM,
            libc::SIGINT,
            libc::SIGHUP,
        ] {
            libc::sigaddset(&raw mut set, signal);
        }
        libc::sigprocmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut());
        set
    }
}

/// Waits until the worker has ended and returns its status; until the engine has, and returns that of a kill.
fn attend(heard: &libc::sigset_t, worker: libc::pid_t, engine: libc::pid_t) -> c_int {
    // SAFETY: the calls get a set of signals and a number of this function or its caller, NULL for what is not wanted, and numbers of processes. The
    // worker has not been waited for yet: its number is no other's.
    unsafe {
        loop {
            // Its own children and what was left to it.
            loop {
                let mut status = 0;
                match libc::waitpid(-1, &raw mut status, libc::WNOHANG) {
                    ended if ended == worker => return status,
                    ended if ended > 0 => {}
                    _ => break,
                }
            }
            let signal = libc::sigwaitinfo(heard, std::ptr::null_mut());
            if libc::getppid() != engine {
                return libc::SIGKILL;
            }
            // The engine's go to the whole group; those of others may be for this process alone.
            if signal == libc::SIGTERM {
                libc::kill(worker, signal);
            }
        }
    }
}

/// Ends this process with the status of another: its code, or the signal that killed it.
fn end_as(status: c_int) -> ! {
    // SAFETY: the calls get a limit and a set of signals (plain bits) of this function, numbers, and NULL for what is not wanted; the signal's
    // handler is the system's own.
    unsafe {
        if !libc::WIFSIGNALED(status) {
            libc::_exit(libc::WEXITSTATUS(status));
        }
        let signal = libc::WTERMSIG(status);
        // The worker has left its own image of memory, if any is wanted.
        let none = libc::rlimit {
            rlim_cur: 0,
            rlim_max: 0,
        };
        libc::setrlimit(libc::RLIMIT_CORE, &raw const none);
        libc::signal(signal, libc::SIG_DFL);
        let mut set: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut set);
        libc::sigaddset(&raw mut set, signal);
        libc::sigprocmask(libc::SIG_UNBLOCK, &raw const set, std::ptr::null_mut());
        libc::kill(libc::getpid(), signal);
        libc::_exit(128 + signal)
    }
}

/// Kills the children of this process but `spared`, and what they leave to it, until there are none.
fn end_all(spared: &[u32]) {
    // Each round kills one generation; a bound, because one that forks without end would never let go.
    for _ in 0..10_000 {
        let mut any = false;
        for child in children() {
            if spared.contains(&child) {
                continue;
            }
            let Ok(child) = libc::pid_t::try_from(child) else {
                continue;
            };
            any = true;
            // SAFETY: numbers and NULL. A child that has not been waited for: its number is no other's.
            unsafe {
                libc::kill(child, libc::SIGKILL);
                libc::waitpid(child, std::ptr::null_mut(), 0);
            }
        }
        if !any {
            return;
        }
    }
}

/// Processes whose parent is this one.
fn children() -> Vec<u32> {
    let threads = std::fs::read_dir("/proc/self/task");
    let lists = threads.into_iter().flatten().flatten();
    let texts: Vec<_> = lists
        .map(|t| std::fs::read_to_string(t.path().join("children")))
        .collect();
    if texts.iter().any(Result::is_ok) {
        let words = texts.iter().flatten().flat_map(|t| t.split_whitespace());
        return words.filter_map(|w| w.parse().ok()).collect();
    }
    // A kernel without these lists: the fourth word of each process's line, behind its name in brackets.
    let me = std::process::id().to_string();
    let all = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let is_child = |pid: &u32| {
        let line = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        let behind = line.rsplit(')').next().unwrap_or_default();
        behind.split_whitespace().nth(1) == Some(&me)
    };
    all.filter_map(|e| e.file_name().to_str()?.parse().ok())
        .filter(is_child)
        .collect()
}

static ADOPTING: AtomicBool = AtomicBool::new(false);

/// What ended workers leave to the engine.
pub struct Orphans;

impl Orphans {
    /// Makes this process the one to which the orphans of its workers go. Not where it began with children that are not its own
    /// (`sh -c 'server & exec plyflow run ..'`): theirs could not be told from those of a step.
    pub fn adopt() {
        if children().is_empty() {
            // SAFETY: numbers alone.
            unsafe { libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 1 as libc::c_ulong) };
            ADOPTING.store(true, Ordering::Relaxed);
        }
    }

    /// Kills what workers have left whose supervisor was killed (others have left nothing); `workers`: those that still run.
    pub fn end(workers: &[u32]) {
        if ADOPTING.load(Ordering::Relaxed) {
            end_all(workers);
        }
    }
}

/// Overwrites a word of this process's command line, as other programs see it, with another of the same length, so
/// that the two processes of a step can be told apart.
///
/// # Safety
/// `arguments` is the `argv` of `main`, with `count` entries, and the process has one thread: nobody else reads the words meanwhile.
pub unsafe fn rename_argument(
    arguments: *const *const c_char,
    count: c_int,
    from: &std::ffi::CStr,
    to: &std::ffi::CStr,
) {
    if from.count_bytes() != to.count_bytes() {
        return;
    }
    for i in 0..usize::try_from(count).unwrap_or(0) {
        // SAFETY: one of the `count` entries, a text that ends with a zero and may be written to, as C says of the `argv` of `main` (the caller's
        // promise); the new word has as many bytes as the old one.
        unsafe {
            let word = *arguments.add(i);
            if !word.is_null() && std::ffi::CStr::from_ptr(word) == from {
                let bytes = to.to_bytes();
                std::ptr::copy_nonoverlapping(bytes.as_ptr(), word.cast_mut().cast(), bytes.len());
                return;
            }
        }
    }
}
