use super::*;

fn read(text: &str, bare: bool) -> Result<Value, ExpressionError> {
    let all = ["angle", "mu", "layup"].map(str::to_owned);
    let of = [
        Value::of_text("45 deg").unwrap(),
        Value::of_number("0.1").unwrap(),
        Value::Text("L3".into()),
    ];
    Expression::read(text, Names { all: &all, bare })?.value(&of)
}

fn text(given: &str) -> String {
    read(given, false).unwrap().text()
}

#[test]
fn quantities_are_computed_with_their_units() {
    for (given, wanted) in [
        ("-135 deg + ${angle}", "-90 deg"),
        ("${angle}*2", "90 deg"),
        ("2 * ( ${angle} - 5 deg )", "80 deg"),
        ("${angle} / 90 deg", "0.5"),
        ("112.5 N/m * 2", "225 N/m"),
        ("3 N mm - 1 N mm", "2 N mm"),
        ("4 1/mm", "4 1/mm"),
        ("- -3", "3"),
        ("max(1 cm, 12 mm)", "1.2 cm"),
        ("abs(-5 mm)", "5 mm"),
        ("round(10 mm / 3 mm)", "3"),
        ("1e-3 m + 1 mm", "0.002 m"),
        ("0.1 + 0.2", "0.3"),
        ("5 min + 30 s", "5.5 min"),
        ("5 mm-2 mm", "3 mm"),
    ] {
        assert_eq!(text(given), wanted, "{given}");
    }
}

#[test]
fn conditions_compare_what_is_of_one_kind() {
    let holds = |t: &str| read(t, true).unwrap() == Value::Bool(true);
    assert!(holds("mu <= 0.1 and angle > 0 deg"));
    assert!(holds("0 deg <= angle < 90 deg"));
    assert!(!holds("not (layup == 'L3')"));
    assert!(holds("layup != \"L4\" or mu > 1"));
    assert!(holds("${mu} == 10 %"));
    for (wrong, word) in [
        ("mu < 1 mm", "do not go together"),
        ("layup < 'a'", "no order"),
        ("layup == 3", "cannot be compared"),
        ("mu and true", "neither true nor false"),
    ] {
        let e = read(wrong, true).unwrap_err();
        assert!(e.problem.message.contains(word), "{wrong}: {e}");
    }
}

#[test]
fn what_cannot_be_read_is_told_with_its_place() {
    for (given, at, word) in [
        ("1 mm + ${angel}", 7..15, "no variable `angel`"),
        ("1 mm + angle", 7..12, "neither a number nor a variable"),
        ("(1 mm", 5..5, "not closed"),
        ("3 furlong", 0..9, "furlong"),
        ("2 * ", 4..4, "ends where a value"),
        ("1 2", 2..3, "does not go on"),
        (
            "cases/${angle}.yaml",
            0..5,
            "neither a number nor a variable",
        ),
        ("nothing(1)", 0..7, "no function"),
    ] {
        let e = read(given, false).unwrap_err();
        assert!(e.problem.message.contains(word), "{given}: {e}");
        assert_eq!(e.at, at, "{given}: {e}");
    }
    let e = read("1 mm + ${angel}", false).unwrap_err();
    assert_eq!(e.problem.help.as_deref(), Some("did you mean `angle`?"));
    assert!(read(&"(".repeat(5000), false).is_err());
}

#[test]
fn an_expression_as_long_as_a_file_is_refused_and_uses_no_stack() {
    for sign in ["+1", "*1", "-1", "/1"] {
        let e = read(&format!("1{}", sign.repeat(200_000)), false).unwrap_err();
        assert!(e.problem.message.contains("too long"), "{e}");
    }
    assert_eq!(text(&format!("1{}", "+1".repeat(400))), "401");
    assert!(
        read("1e99 mm", false)
            .unwrap_err()
            .problem
            .message
            .contains("more digits")
    );
}

#[test]
fn a_temperature_in_degrees_is_compared_and_never_turned_round() {
    let all = ["t".to_owned()];
    let names = Names {
        all: &all,
        bare: true,
    };
    let of = [Value::of_text("20 degC").unwrap()];
    let holds = |t: &str| Expression::read(t, names).unwrap().holds(&of);
    assert!(holds("t > -5 degC and t < 300 K").unwrap());
    for wrong in ["-t > 0 K", "abs(t) > 0 K", "-(5 degC) < t"] {
        assert!(holds(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn what_does_not_hold_tells_how_far_it_is_from_it() {
    let all = ["x", "layup"].map(str::to_owned);
    let names = Names {
        all: &all,
        bare: true,
    };
    let of = [Value::of_text("3 mm").unwrap(), Value::Text("L3".into())];
    let excess = |t: &str| Expression::read(t, names).unwrap().excess(&of).unwrap();
    let units = |t: &str| {
        Expression::read(t, names)
            .unwrap()
            .excess_units(&of)
            .unwrap()
    };
    assert_eq!(
        units("x <= 5 mm and layup == 'L4' and x / 1 mm < 7"),
        ["m", "", ""]
    );
    assert_eq!(excess("x <= 5 mm"), [0.0]);
    assert_eq!(excess("x <= 1 mm and x > 1 mm"), [0.002, 0.0]);
    assert_eq!(excess("1 mm <= x <= 2 mm"), [0.0, 0.001]);
    assert_eq!(excess("x < 3 mm"), [f64::MIN_POSITIVE]);
    assert_eq!(excess("x == 2 mm or layup == 'L4'"), [1.0]);
    assert_eq!(excess("layup == 'L4' and not (x > 1 m)"), [1.0, 0.0]);
}

#[test]
fn a_variable_where_a_unit_would_stand_is_told_and_never_a_unit() {
    let all = ["h", "angle", "s2"].map(str::to_owned);
    let of = ["2 mm", "45 deg", "3 mm"].map(|t| Value::of_text(t).unwrap());
    let read = |text: &str, bare| Expression::read(text, Names { all: &all, bare });
    for text in ["1/h", "2/h", "1/angle", "3 m/h", "h < 1/h", "1/s2", "1/h^2"] {
        let told = read(text, true).unwrap_err().problem;
        assert!(
            told.message.contains("stands where a unit would"),
            "{text}: {told}"
        );
    }
    let value = |text: &str, bare| read(text, bare).unwrap().value(&of).unwrap().si().unwrap();
    assert_eq!(value("1 / h", true), 500.0);
    assert_eq!(value("1 /h", true), 500.0);
    // Where only `${h}` is a variable, it is the hour; and one word behind a number is a unit everywhere.
    assert_eq!(value("3600/h", false), 1.0);
    assert_eq!(value("2 h", true), 7200.0);
    assert_eq!(value("4 m2 / h", true), 2000.0);
}
