//! Runs in allocations, with commands of Slurm that start the scripts here: what the head, the allocations and the store do is real. What a real
//! Slurm does to them is in `scripts/check-slurm`.

use plyflow_e2e::{Study, ended, wait_for, well};
use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

const PROFILE: &str = "
plyflow_profile: 1
each: {cores: 1, memory: 1 GiB, walltime: 10 min, at_once: 2}
settle: 1 s
idle: 1 s
grace: 5 s
";

/// A study with a profile and commands of Slurm.
struct Cluster {
    study: Study,
    bin: PathBuf,
}

impl Cluster {
    fn new(workflow: &str) -> Self {
        let study = Study::new(workflow);
        let bin = study.path("bin");
        std::fs::create_dir(&bin).expect("a folder");
        std::fs::write(study.path("profile.yaml"), PROFILE).expect("a profile");
        let cluster = Self { study, bin };
        let jobs = cluster.study.path("jobs");
        std::fs::create_dir(&jobs).expect("a folder");
        let jobs = jobs.display();
        cluster.command(
            "sbatch",
            &format!(
                "n=$(($(ls {jobs} | wc -l) + 1)); script=$2\n\
                 name=$(sed -n 's/^#SBATCH --job-name=//p' $script); last=$(sed -n 's/^#SBATCH --array=0-//p' $script)\n\
                 for i in $(seq 0 ${{last:-0}}); do\n\
                 SLURM_ARRAY_TASK_ID=$i SLURMD_NODENAME=here setsid bash $script >>{jobs}/../log-$n-$i 2>&1 </dev/null & echo \"$i $name $!\" >>{jobs}/$n\n\
                 done\necho $n\n"
            ),
        );
        cluster.command(
            "squeue",
            &format!(
                "for job in {jobs}/*; do while read -r i name pid; do\n\
                 if kill -0 $pid 2>/dev/null; then echo \"${{job##*/}}|$i|$name|RUNNING|None|here\"; fi\ndone <$job; done\nexit 0\n"
            ),
        );
        cluster.command(
            "scontrol",
            "[ \"$2\" = config ] || echo 'PartitionName=all Default=YES MaxTime=01:00:00 MaxCPUsPerNode=UNLIMITED MaxMemPerNode=UNLIMITED'\n",
        );
        cluster.command("sinfo", "echo '8|8000|(null)'\n");
        cluster.command("sacct", "exit 1\n");
        cluster.command("scancel", "exit 0\n");
        cluster
    }

    fn command(&self, name: &str, text: &str) {
        let path = self.bin.join(name);
        std::fs::write(&path, format!("#!/bin/bash\n{text}")).expect("a command");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("rights");
    }

    fn plyflow(&self, words: &[&str]) -> Command {
        let mut command = self.study.command(words);
        let path = std::env::var("PATH").expect("a path");
        command.env("PATH", format!("{}:{path}", self.bin.display()));
        command
    }

    fn head(&self, log: &str) -> Child {
        let log = std::fs::File::create(self.study.path(log)).expect("a log");
        let words = [
            "run",
            "--on",
            "profile.yaml",
            "--log-format",
            "json",
            "--no-report",
        ];
        let mut command = self.plyflow(&words);
        command.stdout(Stdio::null()).stderr(log);
        command.spawn().expect("plyflow starts")
    }

    fn run(&self) -> plyflow_e2e::Ended {
        let status = self.head("run.log").wait().expect("a child");
        ended(self.study.log().as_bytes(), status)
    }

    /// How often each value stands behind a word in the ledger.
    fn ledger(&self, word: &str) -> BTreeMap<String, u32> {
        let text = std::fs::read_to_string(self.study.path("ledger")).unwrap_or_default();
        let mut counts = BTreeMap::new();
        for value in text.lines().filter_map(|l| l.strip_prefix(word)) {
            *counts.entry(value.to_owned()).or_default() += 1;
        }
        counts
    }
}

#[test]
fn a_run_on_a_cluster_makes_the_bytes_of_one_at_home() {
    let steps = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  zones: {plugin: split, with: {items: 4}, from: {in: first}}
  mesh: {plugin: mesh, with: {points: 64, frames: 6}, for_each: {z: zones}, from: {in: zones}}
  all: {plugin: sum, from: {in: [mesh, first]}}
";
    let home = Study::new(steps);
    assert_eq!(home.run(&[]), well(7, 0));
    let cluster = Cluster::new(steps);
    assert_eq!(cluster.run(), well(7, 0));
    assert_eq!(cluster.study.artifacts(), home.artifacts());
    assert_eq!(cluster.run(), well(0, 7));
    for folder in ["results", "made", "cancel"] {
        let folder = cluster
            .study
            .path(".plyflow/runs/study/cluster")
            .join(folder);
        assert_eq!(std::fs::read_dir(folder).expect("a folder").count(), 0);
    }
}

#[test]
fn a_killed_head_is_followed_by_another_and_no_step_begins_twice() {
    let cluster = Cluster::new("");
    let ledger = cluster.study.path("ledger");
    cluster.study.write(&format!(
        "study: {{vary: {{n: [1, 2, 3, 4, 5, 6]}}}}\nsteps:\n  a: {{plugin: patient, with: {{value: \"${{n}}\", seconds: 0.6, ledger: {}}}}}\n",
        ledger.display()
    ));
    let mut head = cluster.head("first.log");
    wait_for("steps", || cluster.ledger("begin").len() >= 2);
    head.kill().expect("a head to kill");
    head.wait().expect("a child");
    let end = cluster.run();
    assert_eq!((end.code, end.executed + end.cached), (Some(0), 6));
    for word in ["begin", "end"] {
        let counts = cluster.ledger(word);
        assert_eq!(
            (counts.len(), counts.values().max()),
            (6, Some(&1)),
            "{word}: {counts:?}"
        );
    }
}

#[test]
fn what_a_plugin_fails_of_is_told_as_at_home_and_what_never_fits_is_refused() {
    let cluster = Cluster::new("steps:\n  a: {plugin: error}\n");
    let end = cluster.run();
    assert_eq!((end.code, end.failed), (Some(4), 1));
    assert_eq!(cluster.ledger("begin").len(), 0);
    cluster
        .study
        .write("steps:\n  a: {plugin: trivial, resources: {cores: 9}}\n");
    for words in [
        ["plan", "--on", "profile.yaml"],
        ["run", "--on", "profile.yaml"],
    ] {
        let output = cluster.plyflow(&words).output().expect("plyflow starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{said}");
        assert!(
            said.contains("18 cores (2 steps at a time)") && said.contains("at most 8"),
            "{said}"
        );
    }
}

#[test]
fn a_cancelled_run_stops_with_checkpoints_and_the_next_goes_on_from_them() {
    let cluster = Cluster::new("");
    let ledger = cluster.study.path("ledger");
    cluster.study.write(&format!(
        "study: {{vary: {{n: [1, 2, 3]}}}}\nsteps:\n  a: {{plugin: patient, with: {{value: \"${{n}}\", seconds: 3, ledger: {}}}}}\n",
        ledger.display()
    ));
    let mut head = cluster.head("first.log");
    wait_for("steps", || cluster.ledger("begin").len() >= 2);
    std::thread::sleep(std::time::Duration::from_millis(300));
    let cancelled = cluster
        .plyflow(&["cancel"])
        .output()
        .expect("plyflow starts");
    assert!(cancelled.status.success(), "{cancelled:?}");
    assert_eq!(head.wait().expect("a child").code(), Some(130));
    let end = cluster.run();
    assert_eq!((end.code, end.executed + end.cached), (Some(0), 3));
    assert!(!cluster.ledger("on").is_empty(), "from its checkpoint");
    let ends = cluster.ledger("end");
    assert_eq!((ends.len(), ends.values().max()), (3, Some(&1)), "{ends:?}");
}

#[test]
fn an_optimisation_keeps_its_allocation_from_round_to_round_and_under_another_head() {
    let text = |ledger: &str| {
        format!(
            "optimise:\n  minimise: r\n  over: {{x: {{from: 0, to: 4}}}}\n  method: simplex\n  budget: 10\n\
             steps:\n  a: {{plugin: patient, with: {{value: \"(${{x}} - 1.3) * (${{x}} - 1.3)\", seconds: 0.3, ledger: {ledger}}}}}\n\
             responses:\n  r: {{step: a, result: value}}\n"
        )
    };
    let table = |study: &Study| {
        let output = study.call(&["results", "--study", "--format", "csv"]);
        let text = String::from_utf8(output.stdout).expect("a table");
        // What a step took is another time each time.
        let rows = text.lines().map(|l| l.split(',').take(3).collect());
        rows.collect::<Vec<Vec<_>>>()
            .iter()
            .map(|r| r.join(","))
            .collect::<Vec<_>>()
    };
    let home = Study::new(&text("\"\""));
    assert_eq!(home.run(&[]).code, Some(0));
    let cluster = Cluster::new("");
    let ledger = cluster.study.path("ledger");
    cluster.study.write(&text(ledger.to_str().expect("a path")));
    std::fs::write(
        cluster.study.path("profile.yaml"),
        PROFILE.replace("idle: 1 s", "idle: 30 s"),
    )
    .expect("a profile");
    let mut head = cluster.head("first.log");
    wait_for("some rounds", || cluster.ledger("end").len() >= 4);
    head.kill().expect("a head to kill");
    head.wait().expect("a child");
    let end = cluster.run();
    assert_eq!(end.code, Some(0), "{end:?}");
    let found = table(&cluster.study);
    assert_eq!((found.len(), &found), (11, &table(&home)));
    for word in ["begin", "end"] {
        let counts = cluster.ledger(word);
        assert_eq!(counts.values().max(), Some(&1), "{word}: {counts:?}");
    }
    let jobs = std::fs::read_dir(cluster.study.path("jobs")).expect("a folder");
    assert_eq!(jobs.count(), 1, "one allocation for all rounds");
    // It is not left to wait for more.
    let running = || {
        let output = cluster.plyflow(&["status"]).output().expect("plyflow");
        String::from_utf8_lossy(&output.stdout).contains("RUNNING")
    };
    wait_for("the end of the allocation", || !running());
}

#[test]
fn points_that_fail_in_allocations_use_up_the_time_of_an_optimisation() {
    // Every point fails, and there is always another one to ask for.
    let cluster = Cluster::new(
        "optimise:\n  minimise: r\n  over: {x: {from: 0, to: 4}}\n  method: evolution\n  budget: 200 ms\n\
         steps:\n  formed: {plugin: error, with: {value: \"${x}\", beyond: -1}}\n  a: {plugin: trivial, from: {in: formed}}\n\
         responses:\n  r: {step: a, result: value}\n",
    );
    let end = cluster.run();
    assert!(end.code == Some(0) && end.failed > 0, "{end:?}");
    let kept = cluster.study.path(".plyflow/runs/study/asked.json");
    let kept = std::fs::read_to_string(kept).expect("what was asked");
    let kept: serde_json::Value = serde_json::from_str(&kept).expect("JSON");
    assert!(kept["cpu_seconds"].as_f64() >= Some(0.2), "{kept}");
}
