//! The `plyflow` program.
//!
//! It has a C `main`: workers start by the thousand, and the standard library's preparations (it reads
//! this process's memory map to place a guard for stack overflows) would cost each a tenth of its time.
#![no_main]

use std::ffi::{c_char, c_int};

/// Entry of the program.
///
/// # Safety
/// The C runtime calls it, before there is a second thread, with what C promises of `argc` and `argv`.
// SAFETY (of the name): the program's one `main`, of the type that C gives it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn main(argc: c_int, argv: *const *const c_char) -> c_int {
    // On Linux with glibc the arguments reach the standard library even so.
    if std::env::args_os()
        .nth(1)
        .is_some_and(|a| a == "step-worker")
    {
        let arguments = std::env::args().skip(2);
        let inside = || {
            // SAFETY: the `argv` of `main`, in a child that has one thread, too.
            unsafe {
                plyflow_plugin_host::rename_argument(argv, argc, c"--parent", c"--inside");
            }
        };
        // SAFETY: one thread: the runtime's.
        unsafe { plyflow::worker::main(&arguments.collect::<Vec<_>>(), inside) };
    }
    // As the standard library has it: a closed pipe is an error to handle, not a signal to die by.
    // SAFETY: numbers alone; no handler of this program's is set or replaced.
    unsafe { libc::signal(libc::SIGPIPE, libc::SIG_IGN) };
    // No panic may leave a C function.
    std::panic::catch_unwind(plyflow::cli::main).map_or(101, c_int::from)
}
