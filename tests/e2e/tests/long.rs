//! Minutes, not seconds: `make long`.

use plyflow_e2e::{artifacts, ended, program, repository, signal, wait_for, workers_of};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const WORKFLOW: &str = "workflows/joggle-spar/workflow-coarse.yaml";

fn command(store: &Path, jobs: &str) -> Command {
    let mut command = Command::new(program());
    command.args([
        "run",
        WORKFLOW,
        "--no-report",
        "--log-format",
        "json",
        "--jobs",
        jobs,
        "--store",
    ]);
    command
        .arg(store)
        .current_dir(repository())
        .stdin(Stdio::null())
        .stdout(Stdio::null());
    command
}

/// Runs to the end; returns the seconds that it took.
fn run(store: &Path, jobs: &str) -> f64 {
    let begun = Instant::now();
    let output = command(store, jobs)
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    let end = ended(&output.stderr, output.status);
    assert_eq!(
        end.code,
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    begun.elapsed().as_secs_f64()
}

fn start(store: &Path, jobs: &str) -> Child {
    command(store, jobs).stderr(Stdio::null()).spawn().unwrap()
}

/// Numbers in [0, 1) that look random and are the same in every run (SplitMix64).
struct Moments(u64);

impl Moments {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[test]
#[ignore = "minutes: make long"]
fn the_coarse_joggle_spar_killed_at_20_random_moments_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, killed) = (folder.path().join("whole"), folder.path().join("killed"));
    let seconds = run(&whole, "2");
    let expected = artifacts(&whole);
    assert!(expected.len() >= 4, "{} artifacts", expected.len());
    let mut moments = Moments(20);
    // A kill loses what is in flight, so a kill later than the longest step takes makes progress. Kills
    // range from the very start to beyond the end of what is left.
    for kill in 0..20 {
        let mut engine = start(&killed, "2");
        std::thread::sleep(Duration::from_secs_f64(seconds * moments.next()));
        let over = engine.try_wait().unwrap().is_some();
        if !over {
            signal(&engine, libc::SIGKILL);
        }
        engine.wait().unwrap();
        wait_for("the workers' end", || workers_of(engine.id()) == 0);
        let visible = artifacts(&killed);
        println!(
            "kill {kill}: {} of {} artifacts",
            visible.len(),
            expected.len()
        );
        for (name, bytes) in visible {
            assert!(
                expected.get(&name) == Some(&bytes),
                "kill {kill}: {name} differs"
            );
        }
        if over {
            // Nothing was left to kill: start again from nothing, so that all 20 kills hit a run.
            std::fs::remove_dir_all(&killed).unwrap();
        }
    }
    run(&killed, "2");
    assert!(artifacts(&killed) == expected, "the artifacts differ");
}

#[test]
#[ignore = "minutes: make long"]
fn the_coarse_joggle_spar_has_the_same_bytes_with_1_and_2_jobs() {
    let folder = tempfile::tempdir().unwrap();
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    run(&one, "1");
    run(&two, "2");
    let (one, two) = (artifacts(&one), artifacts(&two));
    assert_eq!(
        one.keys().collect::<Vec<_>>(),
        two.keys().collect::<Vec<_>>()
    );
    for (name, bytes) in &one {
        assert!(two[name] == *bytes, "{name} differs");
    }
}
