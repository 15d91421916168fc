//! Verdicts and means, on made-up rows.

use super::*;

fn row(value: Option<f64>, e: Expectation) -> Row {
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

fn expectation() -> Expectation {
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
    assert_eq!(row(Some(1.05), near.clone()).verdict(), Some("ok"));
    assert_eq!(row(Some(1.2), near.clone()).verdict(), Some("missed"));
    assert_eq!(row(None, near).verdict(), Some("not judged"));
    let bound = Expectation {
        minimum: Some(0.0),
        maximum: Some(2.0),
        ..expectation()
    };
    assert_eq!(row(Some(2.0), bound.clone()).verdict(), Some("ok"));
    assert_eq!(row(Some(-0.1), bound).verdict(), Some("missed"));
}

#[test]
fn what_is_expected_of_an_absent_number_has_its_unit() {
    let e = Expectation {
        minimum: Some(0.01),
        ..expectation()
    };
    let line = results_table(&[absent(&e)]);
    let cells: Vec<&str> = line.lines().nth(1).unwrap().split_whitespace().collect();
    let expected = ["s", "n", "(absent)", "m", ">=", "0.01", "not", "judged"];
    assert_eq!(cells, expected, "{line}");
    assert!(as_csv(&[absent(&e)]).ends_with("s,,n,,m,false,,,0.01,,not judged,\n"));
}

#[test]
fn the_check_fails_by_what_is_missed_and_by_what_is_not_judged() {
    let bound = || Expectation {
        maximum: Some(2.0),
        ..expectation()
    };
    let [met, missed, open] = [Some(1.0), Some(3.0), None].map(|v| row(v, bound()));
    let told = |rows: &[&Row]| {
        let rows: Vec<Row> = rows.iter().map(|r| (*r).clone()).collect();
        check(&rows).map_err(|stop| (stop.code, stop.text))
    };
    let stop = |text: &str| Err((exit::EXPECTATION, text.to_owned()));
    assert_eq!(told(&[&met]), Ok(()));
    assert_eq!(told(&[&met, &missed]), stop("1 expectation missed: s.n"));
    assert_eq!(
        told(&[&missed, &open, &missed]),
        stop("2 expectations missed: s.n, s.n; 1 expectation not judged (no value): s.n")
    );
    assert_eq!(
        told(&[&open, &open]),
        stop("2 expectations not judged (no value): s.n, s.n")
    );
}

#[test]
fn a_reader_that_has_gone_away_leaves_the_verdict_to_the_exit_code() {
    let code = |asked, value| {
        let bound = Expectation {
            maximum: Some(2.0),
            ..expectation()
        };
        let gone = Err(Stop::silent(exit::OK));
        checked(gone, asked, &[row(Some(value), bound)]).map_err(|stop| stop.code)
    };
    assert_eq!(code(true, 3.0), Err(exit::EXPECTATION));
    assert_eq!(code(true, 1.0), Err(exit::OK));
    assert_eq!(code(false, 3.0), Err(exit::OK));
}

#[test]
fn not_a_number_never_meets_an_expectation() {
    let near = Expectation {
        value: Some(1.0),
        tolerance: Some(0.1),
        ..expectation()
    };
    assert_eq!(row(Some(f64::NAN), near).verdict(), Some("missed"));
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
        Some((None, Some("not judged")))
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
        assert_eq!(found, Some((None, Some("not judged"))));
    }
    assert_eq!(value_of(&[], [done(0), done(0)]), None);
    let of_s = [of("s", "a", 1.95), of("s", "b", 2.05)];
    let without_t = value_of(&of_s, [done(2), done(0)]);
    assert_eq!(without_t, Some((Some(2.0), Some("ok"))));
    let all = mean(&e, &rows, &[done(2), done(1)]).unwrap();
    assert_eq!((all.value, all.verdict()), (Some(2.0), Some("ok")));
    assert_eq!(all.title(), "mean of n (s, t)");
}
