//! The `plyflow` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    // Before anything else: workers start by the thousand.
    let mut arguments = std::env::args().skip(1);
    if arguments.next().as_deref() == Some("step-worker") {
        plyflow::worker::main(&arguments.collect::<Vec<_>>());
    }
    ExitCode::from(plyflow::cli::main())
}
