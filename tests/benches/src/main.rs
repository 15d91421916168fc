//! Measures the built program from outside and appends one JSON row per case to a file under
//! `docs/benchmarks`, named after the machine's processor.
//!
//! `plyflow-benches [engine] [points] [kernels] [solver] [profile] [limits] [study] [busy] [ratios]`: these groups, or all.
//! `plyflow-benches compare`: the ratios beside the last recorded ones; records nothing.

mod cases;
mod limits;
mod machine;
mod ratios;
mod solver;

use std::io::Write;

/// A group of cases that are measured together.
type Group = (&'static str, fn() -> Vec<cases::Row>);

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    if wanted == ["compare"] {
        return ratios::compare();
    }
    let groups: [Group; 9] = [
        ("engine", cases::engine),
        ("points", cases::points),
        ("kernels", cases::kernels),
        ("solver", solver::solver),
        ("profile", solver::profile),
        ("limits", limits::limits),
        ("study", cases::study),
        ("busy", solver::busy),
        ("ratios", ratios::ratios),
    ];
    if let Some(odd) = wanted
        .iter()
        .find(|w| groups.iter().all(|g| g.0 != w.as_str()))
    {
        let names = groups.map(|g| g.0).join(", ");
        eprintln!("unknown group '{odd}'; there are: {names}");
        std::process::exit(2);
    }
    let class = machine::class();
    let path = machine::record_file(&class);
    let mut file = std::fs::File::options()
        .create(true)
        .append(true)
        .open(&path)
        .expect("docs/benchmarks can be written");
    for (name, measure) in groups {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == name) {
            continue;
        }
        for row in measure() {
            println!("{:<44} {:>12.4} {}", row.case, row.value, row.unit);
            writeln!(file, "{}", row.json(&class)).expect("a row is written");
        }
    }
    println!("recorded in {}", path.display());
}
