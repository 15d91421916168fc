use super::*;

fn shape() -> Shape {
    Shape {
        cores: 1,
        memory: 1000,
        walltime: 600,
        gpus: 0,
        at_once: 1,
        without: Vec::new(),
    }
}

fn row(state: &str) -> Row {
    Row {
        job: "5".into(),
        index: 0,
        name: "n".into(),
        state: state.into(),
        reason: String::new(),
        nodes: "n7".into(),
    }
}

fn limits() -> Limits {
    Limits {
        memory: Some(4100),
        ..Limits::default()
    }
}

fn silence(state: &str, past: &Past, kept: bool) -> Rule {
    of_silence(Some(&row(state)), past, &shape(), &limits(), kept)
}

fn verdict(outcome: Outcome, told: bool) -> Verdict {
    Verdict {
        attempt: "a".into(),
        pilot: "p".into(),
        host: "n7".into(),
        seconds: 5.0,
        told,
        outcome,
    }
}

/// Follows a rule until it is reported; gives how often it ran again, and the report.
fn until_reported(mut next: impl FnMut(&Past, &Shape) -> Rule) -> (usize, Outcome) {
    let (mut past, mut at) = (Past::default(), shape());
    for n in 0..2000 {
        match next(&past, &at) {
            Rule::Report(outcome) => return (n, outcome),
            Rule::Again { past: p, shape, .. } => (past, at) = (p, shape),
        }
    }
    panic!("it never ends");
}

#[test]
fn every_rule_has_a_bound() {
    let of = |state: &'static str, kept: bool| {
        until_reported(move |past, at| of_silence(Some(&row(state)), past, at, &limits(), kept)).0
    };
    assert_eq!(
        of("OUT_OF_MEMORY", true),
        2,
        "4000 MiB is what a node gives"
    );
    assert_eq!(of("TIMEOUT", false), 2);
    assert_eq!(of("TIMEOUT", true), 1000);
    assert_eq!(of("NODE_FAIL", true), 3);
    assert_eq!(of("CANCELLED", true), 3);
    assert_eq!(of("SOMETHING_NEW", true), 3);
    let (n, outcome) = until_reported(|past, at| of_silence(None, past, at, &limits(), true));
    assert_eq!(n, 3);
    let class = crate::engine::FailureClass::of(&outcome.reason());
    assert_eq!(
        class,
        crate::engine::FailureClass::Machine,
        "nothing is told of the step"
    );
}

#[test]
fn each_class_has_its_own_rule() {
    let past = Past::default();
    let Rule::Again { shape: more, .. } = silence("OUT_OF_MEMORY", &past, true) else {
        panic!("more memory");
    };
    assert_eq!(more.memory, 2000);
    let Rule::Again {
        shape: other,
        past: p,
        ..
    } = silence("NODE_FAIL", &past, true)
    else {
        panic!("another node");
    };
    assert_eq!((other.without, p.lost), (vec!["n7".to_owned()], 1));
    let Rule::Again {
        shape: same, why, ..
    } = silence("TIMEOUT", &past, true)
    else {
        panic!("from the checkpoint");
    };
    assert_eq!(same, shape());
    assert!(why.contains("from its checkpoint"), "{why}");
    assert!(matches!(
        silence("PREEMPTED", &past, false),
        Rule::Again {
            past: Past {
                barren: 0,
                continued: 1,
                ..
            },
            ..
        }
    ));
}

#[test]
fn what_the_step_does_itself_is_told_and_not_tried_again() {
    let of =
        |v: &Verdict, wished| of_verdict(v, &Past::default(), &shape(), &limits(), true, wished);
    let error = Outcome::Failed {
        kind: FailureKind::Error,
        message: "the mesh is bad".into(),
    };
    for outcome in [
        error,
        Outcome::Signal("SIGSEGV".into()),
        Outcome::Silent(3),
        Outcome::TimedOut(5.0),
    ] {
        assert_eq!(
            of(&verdict(outcome.clone(), true), false),
            Rule::Report(outcome)
        );
    }
    let stopped = verdict(Outcome::Cancelled, true);
    assert!(matches!(of(&stopped, false), Rule::Again { .. }));
    assert_eq!(of(&stopped, true), Rule::Report(Outcome::Cancelled));
    let hungry = Outcome::Failed {
        kind: FailureKind::Error,
        message: format!("{WANTED_MEMORY} of 1.0 GiB"),
    };
    assert!(matches!(
        of(&verdict(hungry, false), false),
        Rule::Again {
            shape: Shape { memory: 2000, .. },
            ..
        }
    ));
}
