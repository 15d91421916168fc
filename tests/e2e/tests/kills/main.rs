//! Kills at random moments, many of them: of the head, of workers, of both.
//!
//! `scripts/kills` does the long form, which goes on after a stop.

mod campaign;

use campaign::{Count, Plan};
use plyflow_e2e::random::Random;
use plyflow_e2e::repository;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A graph of trivial steps: each adds up one to three of those before it, so that there is always something to run side by side.
fn graph(folder: &Path, steps: usize) -> PathBuf {
    let mut random = Random::new(41, 0);
    let mut text = String::from("plyflow: 1\nname: graph\nsteps:\n");
    for k in 0..steps {
        let line = match k {
            0..10 => format!("  s{k}: {{plugin: trivial, with: {{value: {k}}}}}\n"),
            _ => {
                let from: BTreeSet<String> = (0..2 + random.below(2))
                    .map(|_| format!("s{}", random.below(k)))
                    .collect();
                let from = Vec::from_iter(from).join(", ");
                format!("  s{k}: {{plugin: sum, from: {{in: [{from}]}}}}\n")
            }
        };
        text.write_str(&line).expect("memory");
    }
    std::fs::create_dir_all(folder).expect("a folder");
    let file = folder.join("workflow.yaml");
    std::fs::write(&file, text).expect("a workflow");
    file
}

fn judge((count, said): (Count, Vec<String>)) {
    println!("{}", serde_json::to_string(&count).expect("numbers"));
    assert!(said.is_empty(), "{count:?}: {said:#?}");
    let bad = [count.reruns, count.partials, count.leftovers];
    assert_eq!(bad, [0; 3], "reruns, partials, leftovers of {count:?}");
}

#[test]
fn a_graph_killed_at_random_moments_runs_nothing_twice_and_shows_nothing_partial() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path().to_owned();
    let workflow = graph(&folder.join("of"), 60);
    let plan = Plan {
        folder,
        workflow,
        words: &[],
        kills: 12,
        horizon: 0.3,
        seed: 1,
    };
    judge(plan.carry_out());
}

/// The same of a campaign that is long enough for all steps of its workflow to be met.
fn judge_long((count, said): (Count, Vec<String>)) {
    // The last time is that without kills.
    let done = count.done;
    judge((count, said));
    assert!(
        done > 1,
        "the workflow was never done in spite of the kills: they met its first steps alone"
    );
}

/// `PLYFLOW_KILLS` (500).
fn kills() -> u64 {
    std::env::var("PLYFLOW_KILLS").map_or(500, |n| n.parse().expect("a number"))
}

/// Where a campaign lies, so that it goes on after a stop: in `PLYFLOW_KILLS_FOLDER`, or in a folder that goes with the test.
fn place(name: &str) -> (PathBuf, Option<tempfile::TempDir>) {
    match std::env::var_os("PLYFLOW_KILLS_FOLDER") {
        Some(folder) => (Path::new(&folder).join(name), None),
        None => {
            let place = tempfile::tempdir().expect("a folder");
            (place.path().to_owned(), Some(place))
        }
    }
}

#[test]
#[ignore = "many minutes: make long, scripts/kills"]
fn a_graph_of_1000_steps_killed_500_times_runs_nothing_twice_and_shows_nothing_partial() {
    let (folder, _place) = place("graph");
    let workflow = graph(&folder.join("of"), 1000);
    let plan = Plan {
        folder,
        workflow,
        words: &[],
        kills: kills(),
        horizon: 0.1,
        seed: 2,
    };
    judge_long(plan.carry_out());
}

#[test]
#[ignore = "many minutes: make long, scripts/kills"]
fn the_coarse_joggle_spar_killed_500_times_runs_nothing_twice_and_shows_nothing_partial() {
    let (folder, _place) = place("spar");
    let plan = Plan {
        folder,
        workflow: repository().join("workflows/joggle-spar/workflow-coarse.yaml"),
        // Else a run that is killed sooner than its longest step takes would never get on.
        words: &["--checkpoint-every", "500 ms"],
        kills: kills(),
        horizon: 0.2,
        seed: 3,
    };
    judge_long(plan.carry_out());
}
