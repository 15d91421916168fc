//! What a worker needs of the operating system: signals, standard output, costs.

use std::fs::File;
use std::os::fd::FromRawFd;
use std::sync::atomic::{AtomicBool, Ordering};

static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Whether this process was asked to stop (SIGTERM).
pub(crate) fn cancelled() -> bool {
    CANCELLED.load(Ordering::Relaxed)
}

extern "C" fn on_terminate(_: libc::c_int) {
    CANCELLED.store(true, Ordering::Relaxed);
}

/// Makes this process a worker: SIGTERM asks the step to stop, Ctrl-C and a closed terminal are left to the engine
/// (which sends SIGTERM), and the process dies when the thread that started it ends.
pub(crate) fn become_worker() {
    // SAFETY: zeros are an action without flags and mask; the handler is a function that stays, and only stores to an atomic, as a handler may.
    // The other calls take numbers, and NULL for what is not wanted.
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = on_terminate as *const () as usize;
        action.sa_flags = libc::SA_RESTART;
        libc::sigaction(libc::SIGTERM, &raw const action, std::ptr::null_mut());
        libc::signal(libc::SIGINT, libc::SIG_IGN);
        libc::signal(libc::SIGHUP, libc::SIG_IGN);
        #[cfg(target_os = "linux")]
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL as libc::c_ulong);
    }
}

/// Limits the memory that this process may use for data, and tells its libraries; 0: no limit.
///
/// # Safety
/// No other thread exists: one might read the environment.
pub(crate) unsafe fn limit_memory(bytes: u64) {
    if bytes > 0 {
        // SAFETY: nobody else reads or writes the environment (the caller's promise).
        unsafe { std::env::set_var(plyflow_model::budget::MEMORY_VARIABLE, bytes.to_string()) };
        let limit = libc::rlimit {
            rlim_cur: bytes,
            rlim_max: bytes,
        };
        // SAFETY: a whole limit of this function.
        unsafe { libc::setrlimit(libc::RLIMIT_DATA, &raw const limit) };
    }
}

/// Number of threads for libraries that read it from the environment (OpenMP, Rayon).
///
/// # Safety
/// As [`limit_memory`].
pub(crate) unsafe fn announce_threads(threads: u32) {
    for name in ["OMP_NUM_THREADS", "RAYON_NUM_THREADS"] {
        // SAFETY: as in `limit_memory`.
        unsafe { std::env::set_var(name, threads.to_string()) };
    }
}

/// The standard output for messages alone: what a plugin prints goes to standard error.
///
/// Where the system gives no second number for it, it is the number of the standard output itself: called once, by a process that then
/// writes to it through nothing else of its own.
pub(crate) fn private_stdout() -> File {
    // SAFETY: the calls take numbers. The file owns a number that was just made for it; 1 if there is none, see above.
    unsafe {
        let fd = libc::fcntl(1, libc::F_DUPFD_CLOEXEC, 3);
        if fd < 0 {
            return File::from_raw_fd(1);
        }
        libc::dup2(2, 1);
        File::from_raw_fd(fd)
    }
}

/// User and system time of this process (s).
pub(crate) fn cpu_seconds() -> f64 {
    cpu_seconds_of(libc::RUSAGE_SELF)
}

/// User and system time of all processes that this one has started, they and theirs, and that have ended (s).
#[must_use]
pub fn children_seconds() -> f64 {
    cpu_seconds_of(libc::RUSAGE_CHILDREN)
}

/// Largest resident set of a process that this one has started and that has ended (bytes); 0 where there was none.
pub(crate) fn children_peak_memory() -> u64 {
    u64::try_from(usage_of(libc::RUSAGE_CHILDREN).ru_maxrss).unwrap_or(0) * 1024
}

fn usage_of(whose: libc::c_int) -> libc::rusage {
    // SAFETY: numbers alone, for which zeros are values.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: a whole struct of this function.
    unsafe { libc::getrusage(whose, &raw mut usage) };
    usage
}

fn cpu_seconds_of(whose: libc::c_int) -> f64 {
    let usage = usage_of(whose);
    let seconds = |t: libc::timeval| t.tv_sec as f64 + t.tv_usec as f64 * 1e-6;
    seconds(usage.ru_utime) + seconds(usage.ru_stime)
}

/// Largest resident set of this program (bytes). Not from getrusage: its value survives exec, so a
/// worker would report the size of the engine that started it.
pub(crate) fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}

/// Name of the machine.
pub(crate) fn host_name() -> String {
    let mut buffer = [0u8; 256];
    // SAFETY: a buffer of this function and its length, but for a last zero.
    unsafe { libc::gethostname(buffer.as_mut_ptr().cast(), buffer.len() - 1) };
    let end = buffer.iter().position(|b| *b == 0).unwrap_or(0);
    String::from_utf8_lossy(&buffer[..end]).into_owned()
}
