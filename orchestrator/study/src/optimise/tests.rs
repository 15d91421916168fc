use super::search::key;
use super::*;
use crate::{Quantity, Range, Value};

const SIMPLEX: Way = Way::Simplex;

fn evolution(population: usize) -> Way {
    Way::Evolution { population }
}

fn range(from: &str, to: &str) -> Along {
    let q = |t: &str| Quantity::read(t).unwrap().unwrap();
    Along::Range(Range::new(q(from), &q(to), false).unwrap())
}

fn search(way: Way, seed: u64, over: &[(&str, Along)]) -> Search {
    let over = over.iter().map(|(n, a)| ((*n).to_owned(), a.clone()));
    let search = Search {
        over: over.collect(),
        way,
        seed,
        start: None,
    };
    search.check().unwrap();
    search
}

fn si(point: &[Value]) -> Vec<f64> {
    point.iter().map(|v| v.si().unwrap_or(f64::NAN)).collect()
}

fn free(objective: f64) -> Outcome {
    Outcome::Done {
        objective,
        excess: Vec::new(),
    }
}

/// Asks and tells until the budget is spent, as a run of the program does.
fn go_on(search: &Search, budget: usize, told: &mut Vec<Told>, f: &dyn Fn(&[f64]) -> Outcome) {
    while told.len() < budget {
        let Asked::Points(points) = search.ask(told).unwrap() else {
            return;
        };
        for point in points.into_iter().take(budget - told.len()) {
            let outcome = f(&si(&point));
            told.push(Told { point, outcome });
        }
    }
}

fn run(search: &Search, budget: usize, f: &dyn Fn(&[f64]) -> Outcome) -> Vec<Told> {
    let mut told = Vec::new();
    go_on(search, budget, &mut told, f);
    told
}

fn found(told: &[Told]) -> (f64, Vec<f64>) {
    let at = best(told).expect("a feasible point");
    let Outcome::Done { objective, .. } = told[at].outcome else {
        panic!("a result");
    };
    (objective, si(&told[at].point))
}

/// Rosenbrock (1960): 0 at (1, 1).
fn rosenbrock(x: &[f64]) -> Outcome {
    free((1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2))
}

/// Branin (1972): 0.397887 at (-pi, 12.275), (pi, 2.275), (9.42478, 2.475).
fn branin(x: &[f64]) -> f64 {
    let pi = std::f64::consts::PI;
    let curved = x[1] - 5.1 / (4.0 * pi * pi) * x[0] * x[0] + 5.0 / pi * x[0] - 6.0;
    curved * curved + 10.0 * (1.0 - 1.0 / (8.0 * pi)) * x[0].cos() + 10.0
}

fn of_branin(way: Way, seed: u64) -> Search {
    search(
        way,
        seed,
        &[("x", range("-5", "10")), ("y", range("0", "15"))],
    )
}

#[test]
fn the_simplex_goes_along_rosenbrock_s_valley_to_its_end() {
    let search = search(
        SIMPLEX,
        0,
        &[("x", range("-2", "2")), ("y", range("-1", "3"))],
    );
    let told = run(&search, 200, &rosenbrock);
    let (value, at) = found(&told);
    assert!(
        value < 1e-6 && (at[0] - 1.0).abs() < 1e-2,
        "{value} at {at:?} of {}",
        told.len()
    );
}

#[test]
fn evolution_finds_the_lowest_of_branin_s_valleys_whatever_the_seed() {
    for seed in 0..8 {
        let told = run(&of_branin(evolution(8), seed), 240, &|x| free(branin(x)));
        let (value, at) = found(&told);
        assert!(value < 0.41, "{value} at {at:?}, seed {seed}");
    }
}

/// x^2 + y^2 with x + y >= 1: 0.5 at (0.5, 0.5).
fn constrained(x: &[f64]) -> Outcome {
    Outcome::Done {
        objective: x[0] * x[0] + x[1] * x[1],
        excess: vec![(1.0 - x[0] - x[1]).max(0.0)],
    }
}

#[test]
fn a_constraint_is_met_and_what_is_small_lies_on_it() {
    for (way, budget) in [(SIMPLEX, 120), (evolution(8), 200)] {
        let search = search(way, 3, &[("x", range("-2", "2")), ("y", range("-2", "2"))]);
        let told = run(&search, budget, &constrained);
        let (value, at) = found(&told);
        assert!((0.5..0.52).contains(&value), "{way:?}: {value} at {at:?}");
        // The answer of somebody who looks at the number alone would be 0.
        assert!(told.iter().any(|t| !t.outcome.is_feasible()), "{way:?}");
    }
}

#[test]
fn points_that_fail_are_behind_all_others_and_the_rest_of_the_search_is_sound() {
    // Two of Branin's three valleys fail, and everything below 3.5 in the first variable.
    let f = |x: &[f64]| match x[0] < 5.5 {
        true => Outcome::Failed,
        false => free(branin(x)),
    };
    for seed in 0..4 {
        let told = run(&of_branin(evolution(8), seed), 240, &f);
        let failed = told.iter().filter(|t| t.outcome == Outcome::Failed).count();
        let (value, at) = found(&told);
        assert!(
            value < 0.42 && (at[0] - 9.425).abs() < 0.2,
            "{value} at {at:?}, seed {seed}"
        );
        assert!(failed > 3 && failed < 120, "{failed}, seed {seed}");
    }
    // All corners of the first simplex but one fail.
    let f = |x: &[f64]| match x[0] > 0.1 || x[1] > 0.1 {
        true => Outcome::Failed,
        false => free((x[0] + 0.5).powi(2) + (x[1] + 0.3).powi(2)),
    };
    let search = search(
        SIMPLEX,
        0,
        &[("x", range("-1", "1")), ("y", range("-1", "1"))],
    );
    let (value, at) = found(&run(&search, 100, &f));
    assert!(value < 1e-4, "{value} at {at:?}");
}

#[test]
fn where_everything_fails_a_search_ends_with_its_budget_and_without_a_best_point() {
    for way in [SIMPLEX, evolution(6)] {
        let told = run(&of_branin(way, 1), 40, &|_| Outcome::Failed);
        assert!(told.len() <= 40 && best(&told).is_none());
        let search = of_branin(way, 1);
        assert!(trace(&search, &told).unwrap().iter().all(|e| *e
            == Entry {
                feasible: None,
                best: None
            }));
    }
}

#[test]
fn a_search_that_was_stopped_anywhere_or_grows_asks_for_the_same_points() {
    for way in [SIMPLEX, evolution(6)] {
        let search = of_branin(way, 5);
        let f = |x: &[f64]| match x[1] > 12.0 {
            true => Outcome::Failed,
            false => Outcome::Done {
                objective: branin(x),
                excess: vec![(x[0] - 8.0).max(0.0), (1.0 - x[1]).max(0.0)],
            },
        };
        let whole = run(&search, 60, &f);
        for t in &whole {
            let texts: Vec<String> = t.point.iter().map(Value::text).collect();
            assert_eq!(search.read(&texts).as_ref(), Some(&t.point));
        }
        for stop in [1, 2, 3, 5, 8, 13, 21, 40] {
            let mut told = run(&search, stop, &f);
            assert_eq!(told[..], whole[..told.len()], "{way:?} stopped at {stop}");
            go_on(&search, 60, &mut told, &f);
            assert_eq!(told, whole, "{way:?} stopped at {stop}");
        }
        assert_ne!(run(&of_branin(evolution(6), 6), 60, &f), whole);
    }
}

#[test]
fn a_larger_number_changes_nothing_as_long_as_the_order_stays() {
    // The methods see places in an order: a failed point is no number, and so no large one.
    for way in [SIMPLEX, evolution(6)] {
        let points = |f: &dyn Fn(f64) -> f64| -> Vec<Vec<Value>> {
            let told = run(&of_branin(way, 2), 50, &|x| free(f(branin(x))));
            told.into_iter().map(|t| t.point).collect()
        };
        assert_eq!(points(&|v| v), points(&|v| 1e12 * v - 7.0), "{way:?}");
    }
}

#[test]
fn steps_and_choices_are_found_and_a_search_without_new_points_settles() {
    let number = |n: i32| Value::of_number(&n.to_string()).unwrap();
    let steps = Along::Steps((1..=9).map(number).collect());
    let choice = Along::Choice(["a", "b", "c"].map(|t| Value::Text(t.into())).to_vec());
    let mut search = search(evolution(6), 1, &[("n", steps.clone()), ("way", choice)]);
    let mut told: Vec<Told> = Vec::new();
    let f = |p: &[Value]| {
        let n = p[0].si().unwrap() - 7.0;
        free(n * n + if p[1].text() == "c" { 0.0 } else { 5.0 })
    };
    while let Asked::Points(points) = search.ask(&told).unwrap() {
        assert!(told.len() <= 27, "every point once");
        for point in points {
            assert!(told.iter().all(|t| t.point != point));
            let outcome = f(&point);
            told.push(Told { point, outcome });
        }
    }
    let at = best(&told).unwrap();
    assert_eq!(
        (told[at].point[0].text(), told[at].point[1].text()),
        ("7".into(), "c".into())
    );
    search.way = SIMPLEX;
    assert!(
        search
            .check()
            .unwrap_err()
            .message
            .contains("`way` is a choice")
    );
    search.over.truncate(1);
    search.start = Some(vec![number(2)]);
    let told = run(&search, 1000, &|x| free((x[0] - 7.0).powi(2)));
    assert!(told.len() <= 9 && found(&told).1 == [7.0], "{}", told.len());
    search.start = Some(vec![number(20)]);
    assert!(search.check().is_err());
}

#[test]
fn the_trace_tells_the_best_point_so_far_feasible_ones_first() {
    let search = search(SIMPLEX, 0, &[("x", range("0", "1"))]);
    let told: Vec<Told> = [
        Outcome::Failed,
        Outcome::Done {
            objective: 1.0,
            excess: vec![4.0],
        },
        Outcome::Done {
            objective: 9.0,
            excess: vec![2.0],
        },
        Outcome::Done {
            objective: 5.0,
            excess: vec![0.0],
        },
        Outcome::Done {
            objective: 0.0,
            excess: vec![1.0],
        },
        Outcome::Done {
            objective: 4.0,
            excess: vec![0.0],
        },
    ]
    .into_iter()
    .enumerate()
    .map(|(i, outcome)| Told {
        point: vec![Value::of_number(&format!("0.{i}")).unwrap()],
        outcome,
    })
    .collect();
    let entries = trace(&search, &told).unwrap();
    let bests: Vec<Option<usize>> = entries.iter().map(|e| e.best).collect();
    assert_eq!(bests, [None, Some(1), Some(2), Some(3), Some(3), Some(5)]);
    assert_eq!(best(&told), Some(5));
}

#[test]
fn the_points_are_those_of_every_machine() {
    let texts = |way: Way| -> Vec<String> {
        let told = run(&of_branin(way, 7), 14, &|x| free(branin(x)));
        told.iter()
            .map(|t| key(&t.point).replace('\u{1f}', " "))
            .collect()
    };
    assert_eq!(texts(SIMPLEX)[9..], SIMPLEX_POINTS);
    assert_eq!(texts(evolution(6))[9..], EVOLUTION_POINTS);
}

const SIMPLEX_POINTS: [&str; 5] = [
    "-0.3125 4.6875",
    "1.09375 6.09375",
    "0.15625 5.15625",
    "0.85938 5.85938",
    "0.625 5.625",
];
const EVOLUTION_POINTS: [&str; 5] = [
    "3.22169 7.57655",
    "9.81846 8.99939",
    "-0.82479 3.65169",
    "4.60464 3.31802",
    "5.98953 8.17354",
];
