//! Verdicts and means, on made-up rows.

use super::super::row::Verdict;
use super::*;

pub(crate) fn row(value: Option<f64>, e: Expectation) -> Row {
    Row {
        step: "s".into(),
        item: vec![],
        name: "n".into(),
        value,
        unit: "m".into(),
        measured: false,
        expected: Some(e),
    }
}

pub(crate) fn expectation() -> Expectation {
    Expectation {
        step: "s".into(),
        mean_over: vec![],
        result: "n".into(),
        unit: "m".into(),
        value: None,
        tolerance: None,
        minimum: None,
        maximum: None,
        source: None,
    }
}

#[test]
fn a_number_outside_its_bound_or_tolerance_is_missed() {
    let near = Expectation {
        value: Some(1.0),
        tolerance: Some(0.1),
        ..expectation()
    };
    assert_eq!(row(Some(1.05), near.clone()).verdict(), Some(Verdict::Ok));
    assert_eq!(
        row(Some(1.2), near.clone()).verdict(),
        Some(Verdict::Missed)
    );
    assert_eq!(row(None, near).verdict(), Some(Verdict::NotJudged));
    let bound = Expectation {
        minimum: Some(0.0),
        maximum: Some(2.0),
        ..expectation()
    };
    assert_eq!(row(Some(2.0), bound.clone()).verdict(), Some(Verdict::Ok));
    assert_eq!(row(Some(-0.1), bound).verdict(), Some(Verdict::Missed));
}

#[test]
fn not_a_number_never_meets_an_expectation() {
    let near = Expectation {
        value: Some(1.0),
        tolerance: Some(0.1),
        ..expectation()
    };
    assert_eq!(row(Some(f64::NAN), near).verdict(), Some(Verdict::Missed));
}

#[test]
fn a_mean_counts_every_item_of_its_steps_once_and_wants_all_steps() {
    let of = |step: &str, item: &str, value: f64| Row {
        step: step.into(),
        item: vec![item.into()],
        expected: None,
        ..row(Some(value), expectation())
    };
    let e = Expectation {
        mean_over: vec!["s".into(), "t".into()],
        value: Some(2.0),
        tolerance: Some(0.1),
        ..expectation()
    };
    let done = |count| Progress {
        count,
        unfinished: vec![],
        hidden: false,
    };
    let value_of = |rows: &[Row], progress: [Progress; 2]| {
        mean(&e, rows, &progress).map(|row| (row.value, row.verdict()))
    };
    let mut rows = vec![of("s", "a", 1.0), of("s", "b", 2.0), of("u", "a", 50.0)];
    assert_eq!(
        value_of(&rows, [done(2), done(1)]),
        Some((None, Some(Verdict::NotJudged)))
    );
    rows.extend([of("t", "a", 3.0), of("t", "a", 3.0)]);
    // An item that is not finished, or a collection that is not there yet, leaves no mean; an empty one leaves nothing to say.
    let unfinished = Progress {
        unfinished: vec![vec!["b".into()]],
        ..done(2)
    };
    let hidden = Progress {
        hidden: true,
        ..done(0)
    };
    for progress in [[unfinished, done(1)], [hidden, done(1)]] {
        let found = value_of(&rows, progress);
        assert_eq!(found, Some((None, Some(Verdict::NotJudged))));
    }
    assert_eq!(value_of(&[], [done(0), done(0)]), None);
    let of_s = [of("s", "a", 1.95), of("s", "b", 2.05)];
    let without_t = value_of(&of_s, [done(2), done(0)]);
    assert_eq!(without_t, Some((Some(2.0), Some(Verdict::Ok))));
    let all = mean(&e, &rows, &[done(2), done(1)]).unwrap();
    assert_eq!((all.value, all.verdict()), (Some(2.0), Some(Verdict::Ok)));
    assert_eq!(all.title(), "mean of n (s, t)");
}
