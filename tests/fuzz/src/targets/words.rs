//! Quantities with units, and expressions over them.

use plyflow_model::units::{Dimension, parse_quantity, parse_quantity_in, parse_unit, si_text};
use plyflow_study::{Expression, Kind, Names, Template, Value};
use std::sync::LazyLock;

/// The bytes as a quantity of each dimension: what is one is finite, and its text in SI is read as the same number.
pub(super) fn quantity(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    for dimension in Dimension::ALL {
        match parse_quantity(text, dimension) {
            Ok(value) => {
                assert!(value.is_finite(), "{value} of {text:?}");
                let written = si_text(value, dimension);
                let again = parse_quantity(&written, dimension);
                assert_eq!(again, Ok(value), "{text:?} is {written:?}");
            }
            Err(e) => assert!(!e.reason().trim().is_empty() && !e.help().trim().is_empty()),
        }
    }
    let _ = parse_quantity_in(text, "mm");
    if let Ok(unit) = parse_unit(text) {
        let once = unit
            .factor_to(&unit)
            .is_none_or(|(power, a, b)| power == 0 && a == b);
        assert!(once, "a unit is not once itself: {text:?}");
    }
}

static NAMES: LazyLock<Vec<String>> =
    LazyLock::new(|| ["angle", "mu", "layup", "on"].map(str::to_owned).to_vec());

static VALUES: LazyLock<Vec<Value>> = LazyLock::new(|| {
    let text = |t: &str| Value::of_text(t).expect("a value");
    let number = |t: &str| Value::of_cell(t, "").expect("a number");
    vec![text("45 deg"), number("0.3"), text("L4"), Value::Bool(true)]
});

/// The bytes as an expression: an error lies within the text, and so do the names; what has a value has the same again.
pub(super) fn expression(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    for bare in [false, true] {
        let names = Names { all: &NAMES, bare };
        match Expression::read(text, names) {
            Ok(read) => {
                assert!(read.variables().iter().all(|i| *i < NAMES.len()));
                let value = read.value(&VALUES);
                assert_eq!(value, read.value(&VALUES), "another value: {text:?}");
                let _ = (read.holds(&VALUES), read.excess(&VALUES));
            }
            Err(e) => {
                assert!(text.get(e.at.clone()).is_some(), "{:?} of {text:?}", e.at);
            }
        }
    }
    let kinds = [
        Kind::Quantity(Dimension::Angle.exponents()),
        Kind::Quantity([0; 5]),
        Kind::Text,
        Kind::Bool,
    ];
    if let Err(e) = Template::read(text, &NAMES, &kinds) {
        assert!(text.get(e.at.clone()).is_some(), "{:?} of {text:?}", e.at);
    }
}
