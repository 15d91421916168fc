//! What is expected of a family of points, and workflows with a block `optimise`.

mod common;
mod points;

use common::Study;
use plyflow_workflow::resolved::{ResolvedWorkflow, ResponseFrom};
use points::*;

const RESPONSES: &str = "responses:\n  ratio: {step: coarse, result: kinetic_ratio}\n  length: {step: comparison, result: wrinkle_length}\nexpect:\n";

#[test]
fn a_response_may_be_computed_from_the_variables() {
    let block = "  vary:\n    limit: {from: 4 deg, to: 8 deg, by: 2 deg}\n    d: [0.1, 0.2]";
    let study = |response: &str| {
        let all = format!(
            "responses:\n  cost: {response}\nexpect:\n  - {{response: cost, of: max, maximum: 20 deg}}\n"
        );
        with(
            block,
            &[
                LIMIT,
                ("damping: 0.1", "damping: ${d}"),
                ("expect:\n", &all),
            ],
        )
    };
    let w = load(&study("{value: limit * (1 + 10 * d)}"));
    let asked = w.study.as_ref().unwrap();
    let [cost] = &asked.responses[..] else {
        panic!("{:?}", asked.responses)
    };
    let ResponseFrom::Variables { values, .. } = &cost.from else {
        panic!("{cost:?}")
    };
    assert_eq!((cost.unit.as_str(), cost.step()), ("rad", None));
    // 4, 6 and 8 deg, each with 0.1 and 0.2.
    let degrees = [8.0, 12.0, 12.0, 18.0, 16.0, 24.0];
    assert_eq!(values.len(), degrees.len());
    for (value, degrees) in values.iter().zip(degrees) {
        assert!(
            (value - f64::to_radians(degrees)).abs() < 1e-15,
            "{values:?}"
        );
    }
    for (response, says) in [
        ("{value: limits + d}", "did you mean `limit`"),
        ("{value: limit + d}", "do not go together"),
        ("{value: limit < 5 deg}", "is no number"),
        (
            "{value: limit, step: coarse, result: kinetic_ratio}",
            "beside what is read from a step",
        ),
        ("{value: limit, of: max}", "beside what is read from a step"),
        ("{step: coarse}", "no `result` of that step"),
        ("{result: kinetic_ratio}", "no `step` that has that result"),
        ("{}", "it comes from nowhere"),
    ] {
        let found = told(&study(response));
        assert!(found.contains(says), "{response}: {found}");
    }
}

#[test]
fn expectations_over_a_study_are_read_with_their_units_and_points() {
    let block = "  vary:\n    limit: {from: 0 deg, to: 8 deg, by: 2 deg}\n    d: [0.1, 0.2]";
    let expect = format!(
        "{RESPONSES}  - {{response: length, of: argmax, over: limit, value: 4 deg, tolerance: 1 deg, where: 'd < 0.2', source: s}}\n  \
         - {{response: length, of: symmetric_about, over: limit, about: 4 deg, relative_tolerance: 0.2}}\n  \
         - {{response: length, of: zero_where, where: 'limit == 0 deg', tolerance: 1 mm}}\n  \
         - {{response: ratio, of: monotone, over: d, direction: decreasing}}\n  - {{response: ratio, maximum: 0.05}}\n"
    );
    let study = with(
        block,
        &[
            LIMIT,
            ("damping: 0.1", "damping: ${d}"),
            ("expect:\n", &expect),
        ],
    );
    let w = load(&study);
    let found = &w.study.as_ref().unwrap().expectations;
    assert_eq!(found.len(), 5);
    assert_eq!(
        (found[0].value, found[0].tolerance),
        (Some(4f64.to_radians()), Some(1f64.to_radians()))
    );
    assert_eq!((found[0].points.len(), found[0].over), (5, Some(0)));
    assert_eq!(
        (found[1].about.clone(), found[1].relative_tolerance),
        (Some((4f64.to_radians(), "4 deg".into())), Some(0.2))
    );
    assert_eq!(
        (found[2].points.len(), found[2].tolerance),
        (2, Some(0.001))
    );
    assert_eq!((found[3].increasing, found[4].maximum), (false, Some(0.05)));
}

#[test]
fn expectations_that_no_point_can_answer_are_refused() {
    let block = "  vary:\n    limit: {from: 0 deg, to: 8 deg, by: 4 deg}";
    for (expect, says) in [
        (
            "response: lenght, of: max, maximum: 1 mm",
            "did you mean `length`",
        ),
        (
            "response: length, of: argmax, value: 4 deg",
            "without the variable",
        ),
        (
            "response: length, of: max, maximum: 5 mm, value: 1 mm, tolerance: -1 mm",
            "`tolerance` is negative",
        ),
        (
            "response: length, of: argmax, over: limit, value: 4 mm",
            "`4 mm` is a length",
        ),
        (
            "response: length, of: symmetric_about, over: limit, about: 1 deg",
            "no two points mirror",
        ),
        (
            "response: length, of: symmetric_about, over: limit, about: 1 mm",
            "expected an angle",
        ),
        (
            "response: length, of: monotone, over: limit",
            "without `direction`",
        ),
        (
            "response: length, of: monotone, over: limit, direction: increasing, where: 'limit < 2 deg'",
            "no two points differ",
        ),
        ("response: length, of: zero_where", "without `where`"),
        (
            "response: length, of: zero_where, where: 'limit > 9 deg'",
            "at no point",
        ),
        ("response: length, of: max", "states nothing"),
        (
            "response: length, of: max, minimum: 5 mm, maximum: 1 mm",
            "`minimum` is greater than `maximum`",
        ),
        (
            "response: length, of: max, value: 5 mm, tolerance: 1 mm, maximum: 3.9 mm",
            "`value` lies beyond `maximum` by more than its tolerance",
        ),
        (
            "response: length, of: max, value: 2 mm, tolerance: 1 mm, minimum: 3.1 mm",
            "`value` lies beyond `minimum` by more than its tolerance",
        ),
        (
            "response: length, of: monotone, over: limit, direction: increasing, maximum: 1 mm",
            "`maximum` with `of: monotone`",
        ),
        (
            "response: length, of: max, over: limit, maximum: 1 mm",
            "`over` with `of: max`",
        ),
    ] {
        let list = format!("{RESPONSES}  - {{{expect}}}\n");
        let told = told(&with(block, &[LIMIT, ("expect:\n", &list)]));
        assert!(told.contains(says), "{expect}\n{told}");
        assert_eq!(told.lines().count(), 1, "{expect}\n{told}");
    }
    for (from, says) in [
        ("ratio:", "has the name of a column"),
        ("length:", "has the name of a variable"),
    ] {
        let to = if from == "ratio:" { "cause:" } else { "limit:" };
        let list = RESPONSES.replace(from, to);
        let told = told(&with(block, &[LIMIT, ("expect:\n", &list)]));
        assert!(told.contains(says), "{told}");
    }
    let fanned = RESPONSES.replace("coarse, result", "local, result");
    let told = told(&with(block, &[LIMIT, ("expect:\n", &fanned)]));
    assert!(
        told.contains("has an item for each of a collection"),
        "{told}"
    );
}

/// The sound study of the other tests as an optimisation with this block.
fn optimised(block: &str, expect: &str) -> Study {
    let study = Study::sound();
    study.mutate(
        W,
        "on_failure: keep-going\n",
        &format!("optimise: {{{block}}}\n"),
    );
    study.mutate(W, LIMIT.0, LIMIT.1);
    study.mutate(W, "expect:\n", &format!("{RESPONSES}{expect}"));
    study
}

const OVER: &str = "over: {limit: {from: 4 deg, to: 8 deg}}";

#[test]
fn an_optimisation_has_the_points_that_it_is_looked_at_with() {
    let block = format!(
        "minimise: length, {OVER}, subject_to: [ratio < 0.1 and length > 0 mm], budget: 40, method: simplex, start: {{limit: 7 deg}}"
    );
    let study = optimised(&block, "");
    let of = |w: &ResolvedWorkflow| -> Vec<String> {
        w.study
            .as_ref()
            .unwrap()
            .points
            .iter()
            .map(|p| p.name.clone())
            .collect()
    };
    let first = load(&study);
    assert_eq!(of(&first), ["limit=7deg", "limit=6deg"]);
    assert_eq!(
        step(&first, "defects@limit=6deg").base.as_deref(),
        Some("defects")
    );
    let o = first.study.unwrap().optimisation.unwrap();
    assert_eq!((o.objective, o.maximise, o.subject_to.len()), (1, false, 1));
    let at = |digest: &str| {
        let digest = digest.to_owned();
        let points = move |name: &str, d: &str, search: &plyflow_study::optimise::Search| {
            assert_eq!((name, d), (first.name.as_str(), digest.as_str()));
            let one = |t: &str| search.read(&[t.to_owned()]);
            Some(
                ["5 deg", "4.5 deg", "8 deg"]
                    .into_iter()
                    .map(|t| one(t).unwrap())
                    .collect(),
            )
        };
        let catalog = common::catalog();
        plyflow_workflow::resolve_with_points(&study.path(W), &catalog, &[], &points).unwrap()
    };
    let w = at(&o.digest).workflow;
    assert_eq!(of(&w), ["limit=5deg", "limit=4.5deg", "limit=8deg"]);
    // What has come of a point: two constraints, of which the second is not met.
    let o = w.study.as_ref().unwrap().optimisation.as_ref().unwrap();
    let (_, points) = o.search.as_ref().unwrap();
    let outcome =
        |ratio, length| o.outcome(w.study.as_ref().unwrap(), &points[0], &[ratio, length]);
    let done = plyflow_study::optimise::Outcome::Done {
        objective: -0.25,
        excess: vec![0.0, 0.25],
    };
    assert_eq!(outcome(Some(0.05), Some(-0.25)), Ok(done));
    assert_eq!(
        outcome(None, Some(0.1)),
        Ok(plyflow_study::optimise::Outcome::Failed)
    );
}

#[test]
fn an_optimisation_that_is_wrong_is_told_where_it_is_wrong() {
    let rest = "budget: 40, method: simplex";
    for (block, says) in [
        (
            format!("{OVER}, {rest}"),
            "without `minimise` or `maximise`",
        ),
        (
            format!("minimise: length, maximise: ratio, {OVER}, {rest}"),
            "`minimise` and `maximise`",
        ),
        (
            format!("minimise: lenght, {OVER}, {rest}"),
            "did you mean `length`",
        ),
        (
            format!("minimise: length, {OVER}, {rest}, subject_to: [ratio < 3 mm]"),
            "do not go together",
        ),
        (
            format!("minimise: length, {OVER}, {rest}, subject_to: [ratios < 3]"),
            "did you mean `ratio`",
        ),
        (
            format!("minimise: length, {OVER}, {rest}, subject_to: [limit < 3 deg]"),
            "names no response",
        ),
        (
            format!("minimise: length, {OVER}, budget: soon, method: simplex"),
            "CPU time, such as `2 h`",
        ),
        (
            format!("minimise: length, {OVER}, budget: 40, method: simplx"),
            "did you mean `simplex`",
        ),
        (
            format!("minimise: length, {OVER}, {rest}, start: {{limit: 9 deg}}"),
            "cannot begin at `9 deg`",
        ),
        (
            format!("minimise: length, {OVER}, {rest}, start: {{limits: 5 deg}}"),
            "`start` has no `limit`",
        ),
        (
            format!("minimise: length, {OVER}, {rest}, population: 8"),
            "it is for `method: evolution`",
        ),
        (
            format!("minimise: length, {OVER}, {rest}, seeds: 8"),
            "did you mean `seed`",
        ),
        (
            format!("minimise: length, over: {{limit: [4 deg, 9 deg, 5 deg]}}, {rest}"),
            "is a choice",
        ),
        (
            format!("minimise: length, over: {{limit: [4 deg, 9 mm]}}, {rest}"),
            "are of two kinds",
        ),
        (
            format!(
                "minimise: length, over: {{limit: {{from: 4 deg, to: 8 deg}}, x: {{from: 1, to: 2}}}}, {rest}"
            ),
            "no step depends on `x`",
        ),
    ] {
        let told = told(&optimised(&block, ""));
        assert!(told.contains(says) && told.contains(W), "{block}\n{told}");
    }
    let block = format!("minimise: length, {OVER}, {rest}");
    for (expect, says) in [
        (
            "{response: length, of: monotone, over: limit, direction: increasing}",
            "`of: monotone` in an optimisation",
        ),
        (
            "{response: length, of: best, over: limit, value: 5 mm}",
            "`5 mm` is a length",
        ),
        ("{response: length, of: best}", "states nothing"),
    ] {
        let told = told(&optimised(&block, &format!("  - {expect}\n")));
        assert!(told.contains(says), "{expect}\n{told}");
    }
    let best = format!("{RESPONSES}  - {{response: length, of: best, maximum: 1 mm}}\n");
    let of_study = told(&with(ANGLES, &[LIMIT, ("expect:\n", &best)]));
    assert!(of_study.contains("`of: best` in a study"), "{of_study}");
}
