//! The `plyflow` program.
//!
//! It has a C `main`: workers start by the thousand, and the standard library's preparations (it reads
//! this process's memory map to place a guard for stack overflows) would cost each a tenth of its time.
#![no_main]

use std::ffi::{c_char, c_int};

/// Entry of the program.
// The C runtime calls it, with what C promises of `argv`.
#[allow(clippy::not_unsafe_ptr_arg_deref)]
#[unsafe(no_mangle)]
pub extern "C" fn main(argc: c_int, argv: *const *const c_char) -> c_int {
    // On Linux with glibc the arguments reach the standard library even so.
    if std::env::args_os()
        .nth(1)
        .is_some_and(|a| a == "step-worker")
    {
        let arguments = std::env::args().skip(2);
        let inside = || unsafe {
            plyflow_plugin_host::rename_argument(argv, argc, c"--parent", c"--inside");
        };
        plyflow::worker::main(&arguments.collect::<Vec<_>>(), inside);
    }
    // As the standard library has it: a closed pipe is an error to handle, not a signal to die by.
    unsafe { libc::signal(libc::SIGPIPE, libc::SIG_IGN) };
    // No panic may leave a C function.
    std::panic::catch_unwind(plyflow::cli::main).map_or(101, c_int::from)
}
