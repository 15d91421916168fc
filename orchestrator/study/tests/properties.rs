//! What holds for all ranges, samples and expressions.

use plyflow_study::{
    Axis, Expression, Method, Names, Points, Quantity, Range, Sample, Step, Table, Template, Value,
    Written, range, sample,
};
use proptest::prelude::*;

fn quantity(number: i32, places: u32, unit: &str) -> Quantity {
    let text = format!("{number}e-{places} {unit}");
    Quantity::read(&text)
        .expect("a quantity")
        .expect("few digits")
}

fn numbers(values: &[Value]) -> Vec<f64> {
    values.iter().map(|v| v.si().expect("a number")).collect()
}

proptest! {
    #[test]
    fn a_stepped_range_has_both_ends_and_equal_steps(from in -10_000i32..10_000, by in 1i32..500, n in 0i32..200, places in 0u32..6) {
        let (a, b, step) = (quantity(from, places, "mm"), quantity(from + by * n, places, "mm"), quantity(by, places, "mm"));
        let values = range(&Range::new(a.clone(), &b, false).unwrap(), &Step::By(step)).unwrap();
        prop_assert_eq!(values.len() as i32, n + 1);
        for (i, v) in values.iter().enumerate() {
            // To the last bit what a user would have written.
            let wanted = quantity(from + by * i as i32, places, "mm");
            prop_assert_eq!(v, &Value::Quantity(wanted.clone()));
            prop_assert_eq!(v.si().unwrap().to_bits(), wanted.si().to_bits());
        }
    }

    #[test]
    fn a_counted_range_has_both_ends_and_grows(from in -1000i32..1000, width in 1i32..5000, count in 2u32..300, log in any::<bool>()) {
        let from = if log { from.abs() + 1 } else { from };
        let (a, b) = (quantity(from, 2, "N/m"), quantity(from + width, 2, "N/m"));
        let values = numbers(&range(&Range::new(a.clone(), &b, log).unwrap(), &Step::Count(count)).unwrap());
        prop_assert_eq!(values.len() as u32, count);
        prop_assert_eq!((values[0], values[count as usize - 1]), (a.si(), b.si()));
        prop_assert!(values.windows(2).all(|w| w[0] < w[1]));
    }

    #[test]
    fn a_value_reads_back_from_its_text(number in -1_000_000i32..1_000_000, places in 0u32..9, unit in 0usize..6) {
        let unit = ["mm", "deg", "N/m", "", "%", "1/mm"][unit];
        let q = quantity(number, places, unit);
        prop_assert_eq!(Quantity::read(&q.text()), Some(Ok(q)));
    }

    #[test]
    fn samples_lie_in_their_ranges_and_reach_their_slices(count in 1u32..200, seed in any::<u64>(), method in 0usize..3) {
        let method = [Method::Sobol, Method::Random, Method::LatinHypercube][method];
        let axis = |a: &str, b: &str, log| Axis::Range(Range::new(Quantity::read(a).unwrap().unwrap(), &Quantity::read(b).unwrap().unwrap(), log).unwrap());
        let asked = Sample { method, count, seed, of: vec![
            ("a".into(), axis("0.1", "0.4", false)),
            ("b".into(), axis("1 kPa", "1 MPa", true)),
            ("c".into(), Axis::List(vec![Value::Bool(true), Value::Bool(false)])),
        ] };
        let table = sample(&asked).unwrap();
        prop_assert_eq!(&table, &sample(&asked).unwrap());
        prop_assert_eq!(table.rows.len() as u32, count);
        for row in &table.rows {
            let (a, b) = (row[0].si().unwrap(), row[1].si().unwrap());
            prop_assert!((0.1..=0.4).contains(&a) && (1e3..=1e6).contains(&b));
        }
    }

    #[test]
    fn a_point_is_there_once_under_a_name_of_its_own(values in prop::collection::vec((0i32..20, "[a-c,=@% ]{0,3}"), 1..40)) {
        let rows: Vec<Vec<Value>> = values.iter().map(|(n, t)| vec![Value::Quantity(quantity(*n, 1, "deg")), Value::Text(t.clone())]).collect();
        let mut distinct: Vec<_> = values.clone();
        distinct.sort();
        distinct.dedup();
        let points = Points::new(Table { names: vec!["a".into(), "t".into()], rows }).unwrap();
        prop_assert_eq!(points.all.len(), distinct.len());
        let mut names: Vec<_> = points.all.iter().map(|p| p.name.clone()).collect();
        prop_assert!(names.iter().all(|n| !n.contains(['@', ' ', '['])));
        names.sort();
        names.dedup();
        prop_assert_eq!(names.len(), points.all.len());
    }

    #[test]
    fn sums_of_decimals_are_those_of_whole_numbers(a in -100_000i32..100_000, b in -100_000i32..100_000, places in 0u32..6) {
        let names = ["a".to_owned(), "b".to_owned()];
        let of = [Value::Quantity(quantity(a, places, "mm")), Value::Quantity(quantity(b, places, "mm"))];
        let read = |t: &str| Expression::read(t, Names { all: &names, bare: false }).unwrap().value(&of).unwrap();
        prop_assert_eq!(read("${a} + ${b}"), Value::Quantity(quantity(a + b, places, "mm")));
        prop_assert_eq!(read("${a} - ${b}"), Value::Quantity(quantity(a - b, places, "mm")));
        prop_assert_eq!(read("-(3 * ${a}) / 3"), Value::Quantity(quantity(-a, places, "mm")));
    }

    #[test]
    fn no_text_makes_the_readers_panic(text in "[-+*/().,${}a-z0-9 '\"°<>=!µ%^]{0,40}") {
        let names = ["a".to_owned(), "mm".to_owned()];
        let of = [Value::of_text("45 deg").unwrap(), Value::Text("x".into())];
        let kinds: Vec<_> = of.iter().map(Value::kind).collect();
        for bare in [true, false] {
            match Expression::read(&text, Names { all: &names, bare }) {
                Ok(e) => drop(e.value(&of)),
                Err(e) => prop_assert!(text.get(e.at.start..e.at.end.min(text.len())).is_some(), "{e:?}"),
            }
        }
        if let Ok(Some(t)) = Template::read(&text, &names, &kinds) {
            drop(t.written(&of));
        }
        let _ = Value::of_cell(&text, "mm").map(|v| v.label());
    }
}

#[test]
fn a_whole_number_stays_one_so_that_a_parameter_takes_it() {
    let value = Value::of_number("3").unwrap();
    assert_eq!(value.written(), Written::Integer(3));
}

#[test]
fn a_rate_keeps_its_number_in_the_name_of_a_point() {
    let label = |text: &str| Value::of_text(text).unwrap().label();
    assert_eq!(label("5 1/s"), "5/s");
    assert_eq!(label("51 1/s"), "51/s");
    assert_eq!(label("5 m/s"), "5m/s");
    assert_eq!(label("5 deg"), "5deg");
}
