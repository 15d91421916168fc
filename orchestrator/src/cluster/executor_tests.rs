//! With a Slurm of shell scripts, and allocations that the test plays itself.

use super::*;
use crate::cluster::folder::{Beat, Exchange};
use crate::store::ENDING;
use plyflow_model::job::{Cost, FailureKind, JOB_VERSION, Job, LibraryRef};
use plyflow_model::units::Time;
use std::os::unix::fs::PermissionsExt;

const KEY: &str = "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff";

const FAST: Pace = Pace {
    asks: [Duration::from_millis(150), Duration::from_secs(10)],
    tends: [Duration::from_millis(20); 2],
    not_yet: Duration::from_millis(400),
    later: [Duration::from_millis(100); 2],
};

/// A folder with a run and commands that do as the files in it say.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let at = bench.path("");
        std::fs::create_dir(bench.path("states")).unwrap();
        bench.command(
            "sbatch",
            &format!("echo x >>{at}/sbatch.calls\nif [ -e {at}/sbatch.says ]; then cat {at}/sbatch.says >&2; exit 1; fi\necho 4711\n"),
        );
        // Of each name: what `states/NAME` says, else what `default` says, else that it waits; nothing of what is GONE.
        bench.command(
            "squeue",
            &format!(
                "[ -e {at}/squeue.dead ] && exit 1\nfor n in \"$@\"; do case $n in --name=*) names=${{n#--name=}};; esac; done\n\
                 for n in $(echo \"$names\" | tr , ' '); do\n\
                 s=$(cat {at}/states/$n 2>/dev/null || cat {at}/default 2>/dev/null || echo PENDING)\n\
                 [ $s = GONE ] || echo \"4711|N/A|$n|$s|NonZeroExitCode|n1\"\ndone\nexit 0\n"
            ),
        );
        bench.command(
            "sacct",
            &format!("echo x >>{at}/sacct.calls\necho 'accounting is disabled' >&2\nexit 1\n"),
        );
        bench.command("scancel", &format!("echo \"$@\" >>{at}/scancel.calls\n"));
        bench
    }

    fn path(&self, name: &str) -> Utf8PathBuf {
        Utf8PathBuf::from_path_buf(self.folder.path().join(name)).unwrap()
    }

    fn command(&self, name: &str, text: &str) {
        let path = self.path(name);
        std::fs::write(&path, format!("#!/bin/sh\n{text}")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn calls(&self, name: &str) -> usize {
        let text = std::fs::read_to_string(self.path(&format!("{name}.calls")));
        text.map_or(0, |t| t.lines().count())
    }

    /// What `squeue` says of the first submission.
    fn row(&self, state: &str) {
        let name = &self.exchange().submissions()[0];
        std::fs::write(self.path("states").join(name), state).unwrap();
    }

    fn open(&self) -> Cluster {
        self.open_with(1000)
    }

    fn open_with(&self, most_requests: usize) -> Cluster {
        let profile = Profile {
            settle: Time(0.1),
            ..Profile::default()
        };
        let means = Means {
            profile,
            limits: Limits::default(),
            program: "/bin/true".into(),
            slurm: Slurm::in_folder(&self.path(""), most_requests),
        };
        Cluster::open_at(&self.path("run"), means, None, FAST).unwrap()
    }

    fn exchange(&self) -> Exchange {
        Exchange::new(&self.path("run"))
    }

    fn task(&self, id: usize) -> Task {
        let library = LibraryRef {
            name: "p".into(),
            path: "/p.so".into(),
            hash: None,
        };
        let job = Job {
            version: JOB_VERSION,
            step: "a".into(),
            item: Vec::new(),
            key: KEY.into(),
            plugin: library,
            components: Vec::new(),
            search_path: Vec::new(),
            parameters: serde_json::json!({}),
            inputs: Vec::new(),
            output_kind: "test".into(),
            collection: false,
            threads: 1,
            memory_limit: 0,
            artifact: "/nowhere".into(),
            record: "/nowhere".into(),
            scratch: "/nowhere".into(),
            checkpoints: None,
            provenance: serde_json::json!({}),
        };
        Task {
            id,
            job,
            time_limit: 0.0,
            log: self.path("a.log"),
        }
    }

    /// An allocation takes the order that waits.
    fn take(&self) -> (Order, String) {
        let exchange = self.exchange();
        let pilot = format!("{}_0", exchange.submissions().pop().unwrap());
        let shape = exchange
            .shapes()
            .into_iter()
            .find(|s| !exchange.waiting(s).is_empty())
            .unwrap();
        let attempt = exchange.waiting(&shape)[0].clone();
        (exchange.take(&shape, &attempt, &pilot).unwrap(), pilot)
    }

    fn beat(&self, count: u64) {
        let beat = Beat {
            count,
            host: "n1".into(),
            ..Beat::default()
        };
        let name = &self.exchange().submissions()[0];
        let path = self.exchange().submission(name).join("beat-0.json");
        publish(&path, &to_sealed(&beat).unwrap(), false).unwrap();
    }

    fn tell(&self, order: &Order, outcome: Outcome) {
        let verdict = Verdict {
            attempt: order.attempt.clone(),
            pilot: format!("{}_0", self.exchange().submissions()[0]),
            host: "n1".into(),
            seconds: 0.1,
            told: false,
            outcome,
        };
        self.exchange().tell(&verdict, false).unwrap();
    }
}

/// The end of a step that made `bytes`, of which only some are there yet.
fn done(order: &Order, bytes: &[u8], there: usize) -> Outcome {
    std::fs::write(&order.job.artifact, &bytes[..there]).unwrap();
    let record = Record {
        version: JOB_VERSION,
        step: "a".into(),
        item: Vec::new(),
        key: KEY.into(),
        kind: "test".into(),
        bytes: bytes.len() as u64,
        hash: blake3::hash(bytes).to_hex().to_string(),
        cost: Cost::default(),
        results: Vec::new(),
        collection: None,
        warnings: Vec::new(),
        host: "n1".into(),
        started: 0.0,
    };
    Outcome::Done(Box::new(record))
}

/// Waits for the end of a job, but no longer than this; all that is reported.
fn wait(cluster: &mut Cluster, seconds: f64) -> (Option<Outcome>, String) {
    let until = Instant::now() + Duration::from_secs_f64(seconds);
    let (mut said, mut out) = (String::new(), Vec::new());
    while Instant::now() < until {
        cluster
            .wait(Some(Duration::from_millis(20)), &mut out)
            .unwrap();
        for report in out.drain(..) {
            match report {
                Report::Ended { outcome, .. } => return (Some(outcome), said),
                Report::Message { message, .. } => said += &format!("{message:?}\n"),
            }
        }
    }
    (None, said)
}

fn is_done(outcome: Option<Outcome>) -> bool {
    matches!(outcome, Some(Outcome::Done(_)))
}

#[test]
fn a_step_that_ends_is_taken_up_with_its_files_and_nothing_is_left() {
    let bench = Bench::new();
    let mut cluster = bench.open();
    cluster.submit(bench.task(7));
    assert_eq!(wait(&mut cluster, 0.2).0, None);
    let (order, _) = bench.take();
    assert_eq!((order.job.threads, order.job.memory_limit), (1, 2 << 30));
    std::fs::write(&order.log, "hello").unwrap();
    bench.tell(&order, done(&order, b"artifact", 8));
    assert!(is_done(wait(&mut cluster, 5.0).0));
    let (artifact, record) = cluster.files(7).unwrap();
    assert_eq!(std::fs::read(artifact).unwrap(), b"artifact");
    assert!(
        record.exists(),
        "made from the verdict where it was moved already"
    );
    assert_eq!(
        std::fs::read_to_string(bench.path("a.log")).unwrap(),
        "hello"
    );
    cluster.close();
    let exchange = bench.exchange();
    assert!(exchange.told().is_empty() && !exchange.made(&order.attempt, ENDING).exists());
    assert!(
        exchange
            .shapes()
            .iter()
            .all(|s| exchange.standing(s).is_empty())
    );
    assert_eq!(bench.calls("sbatch"), 1);
}

#[test]
fn that_slurm_does_not_answer_means_nothing() {
    let bench = Bench::new();
    std::fs::write(bench.path("squeue.dead"), "").unwrap();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    wait(&mut cluster, 0.2);
    let (order, _) = bench.take();
    let (ended, said) = wait(&mut cluster, 2.0);
    assert_eq!((ended, said.contains("again")), (None, false), "{said}");
    bench.tell(&order, done(&order, b"x", 1));
    assert!(is_done(wait(&mut cluster, 5.0).0));
    assert_eq!(bench.calls("sbatch"), 1);
}

#[test]
fn a_lost_step_runs_again_and_its_late_end_is_taken_all_the_same() {
    let bench = Bench::new();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    wait(&mut cluster, 0.2);
    let (first, _) = bench.take();
    bench.beat(1);
    bench.row("NODE_FAIL");
    let (ended, said) = wait(&mut cluster, 2.0);
    assert_eq!(ended, None);
    assert!(
        said.contains("the node of allocation 4711 on n1 failed; it is queued again"),
        "{said}"
    );
    let (second, _) = bench.take();
    assert_ne!(first.attempt, second.attempt);
    assert_eq!(
        (second.shape.without.as_slice(), second.past.lost),
        (&["n1".to_owned()][..], 1)
    );
    bench.tell(&first, done(&first, b"late", 4));
    let (ended, said) = wait(&mut cluster, 5.0);
    assert!(is_done(ended) && said.contains("late"), "{said}");
    assert_eq!(std::fs::read(cluster.files(0).unwrap().0).unwrap(), b"late");
    assert_eq!(bench.exchange().to_stop(), [second.attempt]);
}

#[test]
fn an_allocation_that_is_forgotten_without_accounting_is_asked_for_once() {
    let bench = Bench::new();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    wait(&mut cluster, 0.2);
    bench.row("RUNNING");
    bench.take();
    bench.beat(1);
    wait(&mut cluster, 0.3);
    bench.row("GONE");
    let (ended, said) = wait(&mut cluster, 4.0);
    assert_eq!(ended, None);
    assert!(
        said.contains("nobody tells why; it is queued again"),
        "{said}"
    );
    assert_eq!(bench.calls("sacct"), 1);
}

#[test]
fn what_is_not_whole_yet_is_waited_for() {
    let bench = Bench::new();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    wait(&mut cluster, 0.2);
    let (order, _) = bench.take();
    bench.tell(&order, done(&order, b"artifact", 3));
    assert_eq!(wait(&mut cluster, 0.5).0, None);
    std::fs::write(&order.job.artifact, b"artifact").unwrap();
    assert!(is_done(wait(&mut cluster, 5.0).0));
}

#[test]
fn another_head_takes_up_what_runs_and_submits_nothing_twice() {
    let bench = Bench::new();
    let mut first = bench.open();
    first.submit(bench.task(0));
    wait(&mut first, 0.2);
    let (order, _) = bench.take();
    bench.row("RUNNING");
    drop(first);
    let mut second = bench.open();
    second.submit(bench.task(3));
    assert_eq!(wait(&mut second, 0.5).0, None);
    bench.tell(&order, done(&order, b"x", 1));
    assert!(is_done(wait(&mut second, 5.0).0));
    assert_eq!(bench.calls("sbatch"), 1);
}

#[test]
fn a_submission_whose_answer_was_lost_is_found_by_its_name() {
    let bench = Bench::new();
    std::fs::write(
        bench.path("sbatch.says"),
        "Socket timed out on send/recv operation",
    )
    .unwrap();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    wait(&mut cluster, 0.2);
    bench.row("PENDING");
    wait(&mut cluster, 1.0);
    assert_eq!(bench.calls("sbatch"), 1);
    let name = bench.exchange().submissions().remove(0);
    let job = std::fs::read_to_string(bench.exchange().submission(&name).join("job"));
    assert_eq!(job.unwrap(), "4711\n");
}

#[test]
fn one_that_never_arrived_is_submitted_again_under_another_name() {
    let bench = Bench::new();
    std::fs::write(
        bench.path("sbatch.says"),
        "Unable to contact slurm controller",
    )
    .unwrap();
    std::fs::write(bench.path("default"), "GONE").unwrap();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    wait(&mut cluster, 0.2);
    std::fs::remove_file(bench.path("sbatch.says")).unwrap();
    for _ in 0..200 {
        if bench.calls("sbatch") == 2 {
            break;
        }
        wait(&mut cluster, 0.05);
    }
    assert_eq!(bench.calls("sbatch"), 2);
    let names = bench.exchange().submissions();
    let first = bench.exchange().submission(&names[0]);
    assert!(
        first.join("settled").exists(),
        "should it arrive after all, it ends at once"
    );
    assert_eq!(names.len(), 2);
}

#[test]
fn a_limit_is_waited_for_and_a_refusal_is_told() {
    let bench = Bench::new();
    std::fs::write(bench.path("sbatch.says"), "QOSMaxSubmitJobPerUserLimit").unwrap();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    let (ended, said) = wait(&mut cluster, 0.5);
    assert!(
        ended.is_none() && said.contains("takes no more allocations now"),
        "{said}"
    );
    std::fs::write(
        bench.path("sbatch.says"),
        "Invalid partition name specified",
    )
    .unwrap();
    let Some(Outcome::NotStarted(text)) = wait(&mut cluster, 5.0).0 else {
        panic!("it is not told");
    };
    assert!(
        text.contains("Invalid partition") && text.contains("submit.sh"),
        "{text}"
    );
}

#[test]
fn allocations_that_end_before_they_begin_are_not_asked_for_for_ever() {
    let bench = Bench::new();
    std::fs::write(bench.path("default"), "FAILED").unwrap();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    let Some(Outcome::NotStarted(text)) = wait(&mut cluster, 10.0).0 else {
        panic!("it is not told");
    };
    assert!(
        text.contains("3 allocations ended before they began to work, the last as FAILED"),
        "{text}"
    );
    assert_eq!(bench.calls("sbatch"), 3);
}

#[test]
fn no_more_than_ten_requests_are_made_however_fast_it_would_ask() {
    let bench = Bench::new();
    let at = bench.path("");
    bench.command("squeue", &format!("echo x >>{at}/squeue.calls\n"));
    let mut cluster = bench.open_with(10);
    cluster.submit(bench.task(0));
    wait(&mut cluster, 2.0);
    let requests = bench.calls("squeue") + bench.calls("sbatch") + bench.calls("sacct");
    assert!((2..=10).contains(&requests), "{requests}");
}

#[test]
fn one_that_waits_is_taken_back_and_one_that_runs_is_asked_to_stop() {
    let bench = Bench::new();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    cluster.cancel(0, false);
    assert_eq!(wait(&mut cluster, 1.0).0, Some(Outcome::Cancelled));
    cluster.submit(bench.task(1));
    wait(&mut cluster, 0.2);
    bench.row("RUNNING");
    let (order, _) = bench.take();
    cluster.cancel(1, false);
    assert_eq!(
        bench.exchange().to_stop(),
        std::slice::from_ref(&order.attempt)
    );
    assert_eq!(wait(&mut cluster, 0.3).0, None, "it has not ended yet");
    bench.tell(&order, Outcome::Cancelled);
    assert_eq!(wait(&mut cluster, 5.0).0, Some(Outcome::Cancelled));
}

#[test]
fn what_a_plugin_fails_of_is_told_and_not_tried_again() {
    let bench = Bench::new();
    let mut cluster = bench.open();
    cluster.submit(bench.task(0));
    wait(&mut cluster, 0.2);
    let (order, _) = bench.take();
    let failed = Outcome::Failed {
        kind: FailureKind::Error,
        message: "the mesh is bad".into(),
    };
    bench.tell(&order, failed.clone());
    assert_eq!(wait(&mut cluster, 5.0).0, Some(failed));
}

#[test]
fn a_step_whose_allocation_an_earlier_head_has_settled_is_not_waited_for_for_ever() {
    let bench = Bench::new();
    let mut first = bench.open();
    first.submit(bench.task(0));
    wait(&mut first, 0.2);
    bench.take();
    let name = bench.exchange().submissions().remove(0);
    std::fs::write(bench.exchange().submission(&name).join("settled"), "").unwrap();
    drop(first);
    let mut second = bench.open();
    second.submit(bench.task(0));
    let (ended, said) = wait(&mut second, 2.0);
    assert!(
        ended.is_none() && said.contains("it is queued again"),
        "{said}"
    );
}
