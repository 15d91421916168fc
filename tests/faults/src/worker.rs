//! A worker for tests: `faults-worker JOB` and `faults-worker --describe LIBRARY`, as `plyflow step-worker`
//! does them.

fn main() {
    let mut arguments = std::env::args().skip(1);
    let code = match (arguments.next().as_deref(), arguments.next()) {
        (Some("--describe"), Some(library)) => {
            plyflow_plugin_host::describe_main(library.as_str().into(), None)
        }
        // SAFETY: one thread: that of `main`, which has begun no other.
        (Some(job), None) => unsafe { plyflow_plugin_host::worker_main(job) },
        _ => {
            eprintln!("usage: faults-worker JOB | --describe LIBRARY");
            2
        }
    };
    std::process::exit(code);
}
