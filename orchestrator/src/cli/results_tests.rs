//! Tables and verdicts, on made-up rows.

use super::*;
use crate::cli::found::rows::absent;
use crate::cli::found::rows::tests::{expectation, row};
use plyflow_workflow::resolved::Expectation;

#[test]
fn what_is_expected_of_an_absent_number_has_its_unit() {
    let e = Expectation {
        minimum: Some(0.01),
        ..expectation()
    };
    let line = results_table(&[absent(&e)]);
    let cells: Vec<&str> = line.lines().nth(1).unwrap().split_whitespace().collect();
    let expected = ["s", "n", "(absent)", "mm", ">=", "10", "not", "judged"];
    assert_eq!(cells, expected, "{line}");
    assert!(as_csv(&[absent(&e)], &[]).ends_with("s,,n,,m,false,,,0.01,,not judged,\n"));
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
        check(&rows, &[]).map_err(|stop| (stop.code, stop.text))
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
        checked(gone, asked, &[row(Some(value), bound)], &[]).map_err(|stop| stop.code)
    };
    assert_eq!(code(true, 3.0), Err(exit::EXPECTATION));
    assert_eq!(code(true, 1.0), Err(exit::OK));
    assert_eq!(code(false, 3.0), Err(exit::OK));
}
