//! What a step starts dies with it, a closed terminal stops a run cleanly, memory has a bound, and no text of others steers a
//! terminal.

mod stranger;

use std::os::unix::process::CommandExt;
use std::process::Child;
use stranger::{Place, alive, signal, told, wait_for};

const STEP: &str = "steps:\n  one: {plugin: ./libstranger.so}\n";

/// A run whose step does what is asked, with a word of its own in the environment of all that it starts.
fn start(place: &Place, wish: &str, token: &str, more: &[&str]) -> Child {
    let mut words = vec!["run", "--trust", "workflow.yaml", "--no-report", "--quiet"];
    words.extend(more);
    let log = std::fs::File::create(place.path("log")).unwrap();
    let mut command = place.command(&words);
    command.env("STRANGER", wish).env("TOKEN", token);
    command.stdout(log.try_clone().unwrap()).stderr(log);
    // As in a terminal, also where the tests themselves run under `nohup`.
    // SAFETY: between `fork` and `exec` a signal's handling is set, which is async-signal-safe; no handler of this program's is replaced.
    unsafe {
        command.pre_exec(|| {
            libc::signal(libc::SIGHUP, libc::SIG_DFL);
            Ok(())
        });
    }
    command.spawn().unwrap()
}

fn token(name: &str) -> String {
    format!("{name}-{}", std::process::id())
}

#[test]
fn what_a_step_starts_ends_with_it_also_outside_of_its_group_session_and_parent() {
    let place = Place::new(STEP);
    let token = token("end");
    let mut run = start(&place, "fork", &token, &[]);
    assert!(run.wait().unwrap().success());
    assert_eq!(alive(&token), 0);
}

#[test]
fn what_a_step_starts_ends_when_the_head_is_killed() {
    let place = Place::new(STEP);
    let token = token("head");
    let mut run = start(&place, "fork hang", &token, &[]);
    // The run, the two processes of the worker, a child, and one that has left them all.
    wait_for("all processes", || alive(&token) == 5);
    signal(&run, libc::SIGKILL);
    run.wait().unwrap();
    wait_for("their end", || alive(&token) == 0);
}

#[test]
fn what_a_step_starts_ends_when_either_process_of_the_worker_is_killed_or_the_time_is_up() {
    for which in ["--parent", "--inside", "time"] {
        let limited = "steps:\n  one: {plugin: ./libstranger.so, resources: {time_limit: 2 s}}\n";
        let place = Place::new(if which == "time" { limited } else { STEP });
        let token = token(which);
        let mut run = start(&place, "fork hang", &token, &[]);
        if which != "time" {
            wait_for("all processes", || alive(&token) == 5);
            let worker = find_worker(which, run.id()).unwrap();
            // SAFETY: numbers alone; a process of the run, which has just been seen and goes on until it is killed.
            let code = unsafe { libc::kill(worker, libc::SIGKILL) };
            assert_eq!(code, 0);
        }
        assert_eq!(run.wait().unwrap().code(), Some(4), "{which}");
        assert_eq!(alive(&token), 0, "{which}");
    }
}

/// The process of a worker that has this word in its command line, if there is one.
fn find_worker(word: &str, engine: u32) -> Option<i32> {
    let mark = format!("{word}\0{engine}\0");
    let all = std::fs::read_dir("/proc").unwrap().flatten();
    let is = |e: &std::fs::DirEntry| {
        let line = std::fs::read(e.path().join("cmdline")).unwrap_or_default();
        // The one with the signals ahead of it is the worker; what it forked has the same words.
        String::from_utf8_lossy(&line).contains(&mark)
    };
    all.filter(is)
        .filter_map(|e| e.file_name().to_str()?.parse().ok())
        .min()
}

/// Waits until the step of a run is in its worker. To count processes is not enough: while the run reads what the library says of itself, and does
/// not listen to signals yet, there are as many.
fn wait_for_worker(run: &Child, token: &str) {
    let is_there = || find_worker("--inside", run.id()).is_some() && alive(token) == 3;
    wait_for("the worker", is_there);
}

#[test]
fn a_closed_terminal_stops_a_run_as_sigterm_does_and_twice_is_once() {
    let place = Place::new(STEP);
    let token = token("hangup");
    let mut run = start(&place, "hang", &token, &[]);
    wait_for_worker(&run, &token);
    signal(&run, libc::SIGHUP);
    signal(&run, libc::SIGHUP);
    assert_eq!(run.wait().unwrap().code(), Some(130));
    assert_eq!(alive(&token), 0);
}

#[test]
fn who_ignores_a_closed_terminal_goes_on() {
    let place =
        Place::new("steps:\n  one: {plugin: ./libstranger.so, resources: {time_limit: 3 s}}\n");
    let token = token("nohup");
    let mut command = place.command(&["run", "--trust", "workflow.yaml", "--no-report", "--quiet"]);
    command.env("STRANGER", "hang").env("TOKEN", &token);
    // SAFETY: between `fork` and `exec` a signal's handling is set, which is async-signal-safe; no handler of this program's is replaced.
    unsafe {
        command.pre_exec(|| {
            libc::signal(libc::SIGHUP, libc::SIG_IGN);
            Ok(())
        });
    }
    let mut run = command.spawn().unwrap();
    wait_for_worker(&run, &token);
    signal(&run, libc::SIGHUP);
    assert_eq!(
        run.wait().unwrap().code(),
        Some(4),
        "the time limit ends it"
    );
}

#[test]
fn a_step_without_a_bound_of_memory_has_one_and_its_failure_says_it_and_what_to_do() {
    let place = Place::new(STEP);
    let mut run = start(&place, "allocate", "memory", &["--memory", "320MiB"]);
    assert_eq!(run.wait().unwrap().code(), Some(4));
    let text = std::fs::read_to_string(place.path("log")).unwrap();
    assert!(
        text.contains("more memory than its bound of 0.3 GiB"),
        "{text}"
    );
    assert!(text.contains("resources: {memory: ..}"), "{text}");
}

#[test]
fn a_step_that_talks_without_end_has_its_time_limit_and_a_log_of_bounded_length() {
    let limited = "steps:\n  one: {plugin: ./libstranger.so, resources: {time_limit: 2 s}}\n";
    let place = Place::new(limited);
    let begun = std::time::Instant::now();
    let mut run = start(&place, "talk", "talk", &[]);
    assert_eq!(run.wait().unwrap().code(), Some(4));
    assert!(begun.elapsed().as_secs() < 60);
    let log = place.path("there/.plyflow/runs/study/logs/one.log");
    assert!(std::fs::metadata(log).unwrap().len() < 66 << 20);
    let told = std::fs::read_to_string(place.path("log")).unwrap();
    assert!(told.contains("stopped at its time limit"), "{told}");
    assert!(told.len() < 100_000);
}

#[test]
fn no_name_log_or_message_of_others_steers_a_terminal_or_a_page() {
    let place = Place::new(STEP);
    let evil = "\\e]0;title\\a\\u009b2J \\u202e <script>alert(1)</script>\\nstudy: forged line";
    place.write(
        "workflow.yaml",
        &format!("plyflow: 1\nname: \"{evil}\"\ndescription: \"{evil}\"\n{STEP}"),
    );
    let commands: [&[&str]; 10] = [
        &["run", "--trust", "workflow.yaml"],
        &["run", "--trust", "workflow.yaml", "--log-format", "json"],
        &["plan", "workflow.yaml"],
        &["explain", "workflow.yaml", "one"],
        &["results", "workflow.yaml"],
        &["graph", "workflow.yaml"],
        &["validate", "other.yaml"],
        &["validate", "other.yaml", "--format", "json"],
        &["plan", "workflow.yaml", "\u{1b}]0;title\u{7}.yaml"],
        &["plan", "\u{1b}[2J\u{202e}.yaml"],
    ];
    place.write(
        "other.yaml",
        &format!("plyflow: 1\nname: x\nsteps:\n  \"{evil}\": {{plugin: \"{evil}\"}}\n"),
    );
    for words in commands {
        let mut command = place.command(words);
        let output = command.env("STRANGER", "steer").output().unwrap();
        harmless(&told(&output), words);
    }
    // A run that ends well has a page.
    place.good(&["run", "--trust", "workflow.yaml"]);
    let page = std::fs::read_to_string(place.path("there/report.html")).unwrap();
    assert!(page.contains("&lt;script&gt;alert(1)"), "the name is told");
    assert!(!page.contains("<script>alert"));
}

fn harmless(text: &str, words: &[&str]) {
    let steers = |c: &char| c.is_control() && *c != '\n' || ('\u{202a}'..='\u{202e}').contains(c);
    let found = text.chars().find(steers);
    assert_eq!(found, None, "{words:?}: {text:?}");
    assert!(
        !text.lines().any(|l| l.starts_with("study: forged")),
        "{words:?}: {text:?}"
    );
}
