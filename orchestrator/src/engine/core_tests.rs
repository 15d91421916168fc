use super::*;
use crate::plan::tests::{step, workflow};
use plyflow_workflow::resolved::ResolvedStep;

/// Plays a run without processes: what is in `cache` is found, what is in `fails` fails.
struct Play {
    order: Vec<String>,
    skipped: Vec<(String, String)>,
    cached: Vec<String>,
    cancelled: usize,
    most_at_once: usize,
}

#[derive(Default)]
struct Script {
    cores: u32,
    fail_fast: bool,
    /// label of an instance -> number of its items
    items: HashMap<String, u64>,
    /// label -> attempts that fail
    fails: HashMap<String, u32>,
    cache: Vec<String>,
    /// labels of what is in the cache and turns out to be damaged when it is read
    rotten: Vec<String>,
    interrupt_after: Option<usize>,
}

fn play(steps: Vec<ResolvedStep>, script: &Script) -> Play {
    let w = workflow(steps);
    let graph = Graph::new(&w).unwrap();
    let policy = if script.fail_fast {
        FailurePolicy::FailFast
    } else {
        FailurePolicy::KeepGoing
    };
    let limits = Limits {
        cores: script.cores.max(1),
        memory: 0,
        policy,
    };
    let mut core = Core::new(&graph, limits);
    let mut p = Play {
        order: vec![],
        skipped: vec![],
        cached: vec![],
        cancelled: 0,
        most_at_once: 0,
    };
    let mut queue: VecDeque<Effect> = core.start().into();
    let mut running: VecDeque<(Id, u32)> = VecDeque::new();
    let mut interrupted = false;
    loop {
        let event = match queue.pop_front() {
            Some(Effect::Look(id)) => {
                let label = core.label(id);
                let found = script
                    .cache
                    .contains(&label)
                    .then(|| output(script, &label));
                if found.is_some() {
                    p.cached.push(label);
                }
                Event::Looked { id, found }
            }
            Some(Effect::Start { id, .. }) if !rotten_inputs(&core, id, script).is_empty() => {
                Event::Lost {
                    reader: Some(id),
                    ids: rotten_inputs(&core, id, script),
                }
            }
            Some(Effect::Start { id, attempt, .. }) => {
                p.order.push(core.label(id));
                running.push_back((id, attempt));
                p.most_at_once = p.most_at_once.max(running.len());
                continue;
            }
            Some(Effect::Lend { .. }) => continue,
            Some(Effect::Cancel(id)) => {
                p.cancelled += 1;
                running.retain(|(r, _)| *r != id);
                Event::Cancelled { id }
            }
            Some(Effect::Skip { id, cause }) => {
                p.skipped.push((core.label(id), core.label(cause)));
                continue;
            }
            None if script.interrupt_after == Some(p.order.len()) && !interrupted => {
                interrupted = true;
                Event::Interrupt
            }
            None => match running.pop_front() {
                Some((id, attempt)) => {
                    let label = core.label(id);
                    if attempt <= script.fails.get(&label).copied().unwrap_or(0) {
                        Event::Failed { id }
                    } else {
                        Event::Finished {
                            id,
                            output: output(script, &label),
                        }
                    }
                }
                None => break,
            },
        };
        queue.extend(core.handle(event));
    }
    assert!(core.is_finished(), "the run stalls");
    p
}

/// Inputs that were found and are not what was written.
fn rotten_inputs(core: &Core<'_>, id: Id, script: &Script) -> Vec<Id> {
    let givers = core.instances()[id].inputs.iter().map(|(_, giver)| *giver);
    let rotten = |g: &Id| {
        core.instances()[*g].state == State::Done { cached: true }
            && script.rotten.contains(&core.label(*g))
    };
    givers.filter(rotten).collect()
}

fn output(script: &Script, label: &str) -> Output {
    let n = script.items.get(label).copied().unwrap_or(0);
    Output {
        labels: Some(
            (0..n)
                .map(|i| ["A", "B", "C", "D"][i as usize].to_owned())
                .collect(),
        ),
    }
}

fn items(of: &[(&str, u64)]) -> HashMap<String, u64> {
    of.iter().map(|(k, n)| ((*k).to_owned(), *n)).collect()
}

/// coarse -> zones -> local per zone (boundary, fine) -> comparison gathers fine.
fn forming() -> Vec<ResolvedStep> {
    vec![
        step("coarse", &[], &[]),
        step("zones", &[], &[("formed", "coarse")]),
        step(
            "boundary",
            &["zones"],
            &[("zones", "zones"), ("formed", "coarse")],
        ),
        step("fine", &["zones"], &[("boundary", "boundary")]),
        step("compare", &[], &[("global", "coarse"), ("local", "fine")]),
    ]
}

#[test]
fn each_zone_gets_its_own_chain_and_the_comparison_gathers_them_all() {
    let script = Script {
        items: items(&[("zones", 2)]),
        ..Default::default()
    };
    let p = play(forming(), &script);
    let expected = [
        "coarse",
        "zones",
        "boundary[A]",
        "boundary[B]",
        "fine[A]",
        "fine[B]",
        "compare",
    ];
    assert_eq!(p.order, expected);
}

#[test]
fn no_zones_means_no_local_runs_and_the_comparison_still_runs() {
    let p = play(forming(), &Script::default());
    assert_eq!(p.order, ["coarse", "zones", "compare"]);
}

#[test]
fn nested_fan_out_labels_every_level_and_gathers_only_its_own_branch() {
    let steps = vec![
        step("outer", &[], &[]),
        step("inner", &["outer"], &[("in", "outer")]),
        step("leaf", &["outer", "inner"], &[("in", "inner")]),
        step("sum", &["outer"], &[("leaves", "leaf")]),
        step("total", &[], &[("sums", "sum")]),
    ];
    let script = Script {
        items: items(&[("outer", 2), ("inner[A]", 2), ("inner[B]", 1)]),
        ..Default::default()
    };
    let p = play(steps, &script);
    let at = |label: &str| p.order.iter().position(|o| o == label).expect(label);
    assert_eq!(p.order.len(), 1 + 2 + 3 + 2 + 1);
    assert!(at("sum[A]") > at("leaf[A,A]").max(at("leaf[A,B]")));
    assert!(at("sum[B]") > at("leaf[B,A]"));
    assert_eq!(at("total"), 8);
}

#[test]
fn two_fan_outs_meeting_in_one_step_give_every_pair() {
    let steps = vec![
        step("a", &[], &[]),
        step("b", &[], &[]),
        step("x", &["a"], &[]),
        step("pair", &["a", "b"], &[("x", "x"), ("b", "b")]),
    ];
    let script = Script {
        items: items(&[("a", 2), ("b", 2)]),
        ..Default::default()
    };
    let p = play(steps, &script);
    let mut pairs: Vec<&String> = p.order.iter().filter(|o| o.starts_with("pair")).collect();
    pairs.sort();
    assert_eq!(pairs, ["pair[A,A]", "pair[A,B]", "pair[B,A]", "pair[B,B]"]);
}

#[test]
fn a_damaged_input_is_made_again_before_who_reads_it_and_so_are_its_own() {
    let names = |list: &[&str]| list.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
    let mut script = Script {
        cores: 4,
        items: items(&[("zones", 2)]),
        cache: names(&["coarse", "zones", "boundary[A]", "fine[A]"]),
        rotten: names(&["coarse"]),
        ..Default::default()
    };
    // boundary[B] reads `coarse`; nobody reads the damaged one of A.
    let p = play(forming(), &script);
    assert_eq!(p.order, ["coarse", "boundary[B]", "fine[B]", "compare"]);
    // A damaged collection comes back with the same items; who is ready to read it waits.
    script.rotten = names(&["coarse", "zones"]);
    let p = play(forming(), &script);
    let expected = ["coarse", "zones", "boundary[B]", "fine[B]", "compare"];
    assert_eq!(p.order, expected);
    // All the way up, when each is found damaged only when it is read.
    script.cache = names(&["coarse", "zones", "boundary[A]", "boundary[B]", "fine[A]"]);
    script.rotten = names(&["coarse", "zones", "boundary[B]"]);
    let p = play(forming(), &script);
    let expected = ["coarse", "zones", "boundary[B]", "fine[B]", "compare"];
    assert_eq!(p.order, expected);
    assert!(p.skipped.is_empty());
}

#[test]
fn a_damaged_input_that_fails_when_it_is_made_again_skips_who_reads_it() {
    let steps = vec![
        step("a", &[], &[]),
        step("b", &[], &[("in", "a")]),
        step("c", &[], &[("in", "b")]),
    ];
    let script = Script {
        cache: vec!["a".into()],
        rotten: vec!["a".into()],
        fails: [("a".to_owned(), 9)].into(),
        ..Default::default()
    };
    let p = play(steps, &script);
    assert_eq!(p.order, ["a"]);
    let skipped = |x: &str| (x.to_owned(), "a".to_owned());
    assert_eq!(p.skipped, [skipped("b"), skipped("c")]);
}

#[test]
fn a_failure_skips_what_depends_on_it_and_keeps_other_branches() {
    let script = Script {
        items: items(&[("zones", 2)]),
        fails: [("boundary[A]".to_owned(), 9)].into(),
        ..Default::default()
    };
    let p = play(forming(), &script);
    assert!(p.order.contains(&"fine[B]".to_owned()));
    let skipped: Vec<&str> = p.skipped.iter().map(|s| s.0.as_str()).collect();
    assert_eq!(skipped, ["fine[A]", "compare"]);
    assert!(p.skipped.iter().all(|s| s.1 == "boundary[A]"));
}

#[test]
fn a_failed_collection_skips_the_gathering_step_though_no_items_ever_appear() {
    let script = Script {
        fails: [("zones".to_owned(), 9)].into(),
        ..Default::default()
    };
    let p = play(forming(), &script);
    assert_eq!(p.order, ["coarse", "zones"]);
    assert_eq!(p.skipped, [("compare".to_owned(), "zones".to_owned())]);
}

#[test]
fn fail_fast_cancels_what_runs_and_starts_nothing_more() {
    let steps = vec![
        step("a", &[], &[]),
        step("b", &[], &[]),
        step("c", &[], &[]),
    ];
    let script = Script {
        cores: 2,
        fail_fast: true,
        fails: [("a".to_owned(), 9)].into(),
        ..Default::default()
    };
    let p = play(steps, &script);
    assert_eq!(
        (p.order, p.cancelled),
        (vec!["a".to_owned(), "b".to_owned()], 1)
    );
}

#[test]
fn a_step_is_tried_again_as_often_as_it_says() {
    let mut a = step("a", &[], &[]);
    a.retries = 2;
    let fails = |n| Script {
        fails: [("a".to_owned(), n)].into(),
        ..Default::default()
    };
    let again = step("b", &[], &[("in", "a")]);
    let p = play(vec![a.clone(), again.clone()], &fails(2));
    assert_eq!(p.order, ["a", "a", "a", "b"]);
    let p = play(vec![a, again], &fails(3));
    assert_eq!((p.order.len(), p.skipped.len()), (3, 1));
}

#[test]
fn what_the_store_has_is_not_run_even_when_its_input_must_run() {
    let steps = vec![step("a", &[], &[]), step("b", &[], &[("in", "a")])];
    let script = Script {
        cache: vec!["b".into()],
        ..Default::default()
    };
    let p = play(steps, &script);
    assert_eq!(
        (p.order, p.cached),
        (vec!["a".to_owned()], vec!["b".to_owned()])
    );
}

#[test]
fn cores_are_never_given_twice() {
    let mut steps: Vec<ResolvedStep> = (0..6).map(|i| step(&format!("s{i}"), &[], &[])).collect();
    steps[3].resources.cores = 2;
    let p = play(
        steps,
        &Script {
            cores: 2,
            ..Default::default()
        },
    );
    assert_eq!((p.order.len(), p.most_at_once), (6, 2));
}

#[test]
fn a_step_without_stated_cores_gets_all_when_alone_and_a_share_when_not() {
    let threads = |n: usize| {
        let steps: Vec<ResolvedStep> = (0..n)
            .map(|i| {
                let mut s = step(&format!("s{i}"), &[], &[]);
                s.resources.cores = 0;
                s
            })
            .collect();
        let w = workflow(steps);
        let graph = Graph::new(&w).unwrap();
        let limits = Limits {
            cores: 4,
            memory: 0,
            policy: FailurePolicy::KeepGoing,
        };
        let mut core = Core::new(&graph, limits);
        let mut found = vec![];
        for effect in core.start() {
            let Effect::Look(id) = effect else {
                panic!("{effect:?}")
            };
            for e in core.handle(Event::Looked { id, found: None }) {
                let Effect::Start { threads, .. } = e else {
                    panic!("{e:?}")
                };
                found.push(threads);
            }
        }
        found
    };
    assert_eq!(threads(1), [4]);
    assert_eq!(threads(2), [2, 2]);
    assert_eq!(threads(6), [1, 1, 1, 1]);
}

/// What the core says after each of the steps has ended, of four that need 4 cores: `a` takes what it gets, `b` and `c` state one, and `d`,
/// which waits for `c`, two.
#[test]
fn cores_that_nothing_can_be_started_on_are_lent_to_what_runs_and_taken_back() {
    let mut steps = vec![
        step("a", &[], &[]),
        step("b", &[], &[]),
        step("c", &[], &[]),
        step("d", &[], &[("in", "c")]),
    ];
    for (step, cores) in steps.iter_mut().zip([0, 1, 1, 2]) {
        step.resources.cores = cores;
    }
    let w = workflow(steps);
    let graph = Graph::new(&w).unwrap();
    let limits = Limits {
        cores: 4,
        memory: 0,
        policy: FailurePolicy::KeepGoing,
    };
    let mut core = Core::new(&graph, limits);
    let begun = core.start();
    let mut said = Vec::new();
    let mut looks: Vec<Effect> = begun;
    while let Some(Effect::Look(id)) = looks.pop() {
        let effects = core.handle(Event::Looked { id, found: None });
        looks.extend(
            effects
                .iter()
                .filter(|e| matches!(e, Effect::Look(_)))
                .cloned(),
        );
        said.extend(
            effects
                .into_iter()
                .filter(|e| !matches!(e, Effect::Look(_))),
        );
    }
    let start = |id, threads| Effect::Start {
        id,
        threads,
        attempt: 1,
    };
    let lend = |id, threads| Effect::Lend { id, threads };
    assert_eq!(said, [start(0, 1), start(1, 1), start(2, 1), lend(0, 2)]);
    let mut ended = |id| {
        let output = Output::default();
        core.handle(Event::Finished { id, output })
    };
    assert_eq!(ended(1), [lend(0, 3)]);
    assert_eq!(ended(2), [start(3, 2), lend(0, 2)], "taken back");
    assert_eq!(ended(3), [lend(0, 4)]);
    assert_eq!(ended(0), []);
}

#[test]
fn an_interrupt_cancels_what_runs_and_ends() {
    let script = Script {
        items: items(&[("zones", 4)]),
        interrupt_after: Some(3),
        ..Default::default()
    };
    let p = play(forming(), &script);
    assert_eq!((p.order.len(), p.cancelled), (3, 1));
}
