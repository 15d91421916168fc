use super::*;

const DETECTION: &str = r#"{
  "name": "defect-detection", "version": "0.1.0", "vendor": "Plyflow", "kind": "step",
  "role": "defect-detection", "summary": "One sentence.",
  "parameters": {
    "over_shear_positive": {"type": "quantity", "dimension": "angle", "default": "8 deg",
                            "minimum": "0 deg", "maximum": "90 deg", "doc": "Limit."},
    "smoothing": {"type": "integer", "default": 3, "minimum": 0, "doc": "Passes."},
    "mode": {"type": "choice", "values": ["a", "b"], "default": "a", "doc": "Mode."},
    "elements": {"type": "map", "of": {"type": "element"}, "doc": "By sheet."},
    "element": {"type": "element", "required": true, "doc": "Element."}
  },
  "inputs": {"formed": {"kind": "forming", "doc": "Run."}},
  "output": {"kind": "defects"},
  "results": {"flagged_area": {"unit": "m2", "doc": "Area."}, "length": {"unit": "m"}}
}"#;

#[test]
fn the_manual_s_example_is_read() {
    let m = Manifest::parse(DETECTION).unwrap();
    assert_eq!(m.kind, PluginKind::Step);
    assert!(m.inputs["formed"].required && !m.inputs["formed"].many);
    let Shape::Quantity(Dimension::Angle, bounds) = &m.parameters["over_shear_positive"].shape
    else {
        panic!("no angle")
    };
    assert_eq!(bounds.broken_by(2.0).as_deref(), Some("at most 90 deg"));
    assert_eq!(bounds.broken_by(1.0), None);
}

#[test]
fn writing_and_reading_a_manifest_keeps_it() {
    let m = Manifest::parse(DETECTION).unwrap();
    let again = Manifest::parse(&serde_json::to_string(&m).unwrap()).unwrap();
    assert_eq!(m, again);
    assert_eq!(
        m.parameters.get_index(2).unwrap().0,
        "mode",
        "order is kept"
    );
}

#[test]
fn results_with_a_run_time_suffix_are_found_by_their_stem() {
    let m = Manifest::parse(DETECTION).unwrap();
    assert_eq!(m.result("length.AW1").unwrap().unit, "m");
    assert!(m.result("width.AW1").is_none());
}

#[test]
fn slips_in_a_manifest_are_refused() {
    for (from, to, says) in [
        ("\"summary\"", "\"sumary\"", "sumary"),
        (
            "\"dimension\": \"angle\"",
            "\"dimension\": \"angel\"",
            "angel",
        ),
        ("\"dimension\": \"angle\", ", "", "needs `dimension`"),
        (
            "\"maximum\": \"90 deg\"",
            "\"maximum\": 90",
            "must be an angle",
        ),
        (
            "\"maximum\": \"90 deg\"",
            "\"maximum\": \"90 mm\"",
            "is a length",
        ),
        (
            "\"type\": \"integer\"",
            "\"type\": \"int\"",
            "unknown parameter type `int`",
        ),
        (
            "\"type\": \"integer\", \"default\": 3",
            "\"type\": \"boolean\", \"default\": true",
            "no meaning",
        ),
        ("\"output\": {\"kind\": \"defects\"},", "", "needs `output`"),
        ("\"unit\": \"m2\"", "\"unit\": \"qm\"", "qm"),
        (
            "\"default\": \"8 deg\"",
            "\"default\": \"8 mm\"",
            "expected an angle",
        ),
        (
            "\"default\": \"8 deg\"",
            "\"default\": \"98 deg\"",
            "at most 90 deg",
        ),
        (
            "\"default\": 3",
            "\"default\": -1",
            "`default` is -1; expected at least 0",
        ),
        ("\"default\": 3", "\"default\": 2.5", "a whole number"),
        (
            "\"default\": \"a\"",
            "\"default\": \"z\"",
            "one of `a`, `b`",
        ),
        (
            "\"maximum\": \"90 deg\"",
            "\"maximum\": \"-1 deg\"",
            "no value is over",
        ),
        (
            "\"kind\": \"defects\"",
            "\"kind\": \"force curves\"",
            "`output.kind` is `force curves`",
        ),
        (
            "\"inputs\": {\"formed\"",
            "\"inputs\": {\"2nd\"",
            "a port of `inputs` is `2nd`",
        ),
        (
            "\"name\": \"defect-detection\"",
            "\"name\": \"weird.so\"",
            "must not end with `.so`",
        ),
    ] {
        let text = DETECTION.replacen(from, to, 1);
        assert_ne!(text, DETECTION, "{from}");
        let error = Manifest::parse(&text).unwrap_err().to_string();
        assert!(error.contains(says), "{error} should say {says}");
    }
}

#[test]
fn fields_have_plain_names_each_once() {
    let element = |fields: &str| {
        let text = format!(
            r#"{{"name": "e", "version": "1", "vendor": "v", "kind": "element", "role": "element", "summary": "s", "fields": [{fields}]}}"#
        );
        Manifest::parse(&text).map_err(|e| e.to_string())
    };
    let strain = r#"{"name": "strain", "unit": "1"}"#;
    assert_eq!(element(strain).unwrap().fields.len(), 1);
    let e = element(&format!("{strain}, {strain}")).unwrap_err();
    assert!(e.contains("`strain` twice"), "{e}");
    let e = element(r#"{"name": "σ max (1)", "unit": "Pa"}"#).unwrap_err();
    assert!(e.contains("a name of `fields` is `σ max (1)`"), "{e}");
}

#[test]
fn no_key_stands_twice() {
    let step = |what: &str| {
        let text = format!(
            r#"{{"name": "s", "version": "1", "vendor": "v", "kind": "step", "role": "r", "summary": "s", "output": {{"kind": "k"}}, {what}}}"#
        );
        Manifest::parse(&text).map_err(|e| e.to_string())
    };
    let flag = r#""a": {"type": "boolean", "doc": "d"}"#;
    assert!(step(&format!(r#""parameters": {{{flag}}}"#)).is_ok());
    for what in [
        format!(r#""parameters": {{{flag}, {flag}}}"#),
        format!(
            r#""parameters": {{"o": {{"type": "object", "doc": "d", "fields": {{{flag}, {flag}}}}}}}"#
        ),
        r#""inputs": {"a": {"kind": "k", "doc": "d"}, "a": {"kind": "k", "doc": "d"}}"#.into(),
        r#""results": {"a": {"unit": "m", "doc": "d"}, "a": {"unit": "m", "doc": "d"}}"#.into(),
    ] {
        let error = step(&what).unwrap_err();
        assert!(error.contains("`a` stands here twice"), "{what}: {error}");
    }
}

#[test]
fn parameters_become_json_schema() {
    let schema = schema::parameters(&Manifest::parse(DETECTION).unwrap());
    assert_eq!(schema["additionalProperties"], false);
    assert_eq!(schema["required"], serde_json::json!(["element"]));
    assert_eq!(
        schema["properties"]["over_shear_positive"]["x-dimension"],
        "angle"
    );
    assert_eq!(
        schema["properties"]["mode"]["enum"],
        serde_json::json!(["a", "b"])
    );
}

#[test]
fn lists_say_how_many_items_they_take_and_in_which_order() {
    let parse = |list: &str| {
        let text = format!(
            r#"{{"name": "m", "version": "1", "kind": "material", "role": "material", "summary": "s", "parameters": {{"l": {list}}}}}"#
        );
        Manifest::parse(&text).map_err(|e| e.to_string())
    };
    let numbers = r#"{"type": "list", "minimum_items": 2, "maximum_items": 3, "order": "not-falling", "of": {"type": "number"}}"#;
    let read = parse(numbers).unwrap();
    let again = Manifest::parse(&serde_json::to_string(&read).unwrap()).unwrap();
    assert_eq!(read, again);
    let Shape::List(_, items) = &read.parameters["l"].shape else {
        panic!("no list")
    };
    assert_eq!(items.broken_by_count(4).as_deref(), Some("2 to 3 items"));
    assert_eq!(items.broken_by_count(3), None);
    assert_eq!(items.broken_by_order(&[1.0, 1.0]), None);
    assert_eq!(
        items.broken_by_order(&[1.0, 2.0, 1.5]).unwrap().item,
        Some(2)
    );
    for (from, to, says) in [
        (
            "\"maximum_items\": 3",
            "\"maximum_items\": 1",
            "no list has at least 2",
        ),
        ("\"number\"", "\"string\"", "`order` has no meaning"),
        ("not-falling", "falling", "falling"),
    ] {
        let e = parse(&numbers.replace(from, to)).unwrap_err();
        assert!(e.contains(says), "{e}");
    }
}
