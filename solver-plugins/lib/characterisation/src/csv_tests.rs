use super::*;

const WANTED: [Column; 2] = [
    Column::required("displacement", Dimension::Length),
    Column::required("force", Dimension::Force),
];

fn error(text: &str) -> String {
    parse(text, "t.csv", &WANTED).unwrap_err()
}

#[test]
fn values_arrive_in_si_and_keep_their_lines() {
    let text = "\u{feff}# made up\n\nnote [1], force [kN], displacement [mm]\n1,0.002, 10\n# pause\n2,3,1.5e1\n";
    let table = parse(text, "t.csv", &WANTED).unwrap();
    assert_eq!(table.values("displacement").unwrap(), [0.01, 0.015]);
    assert_eq!(table.values("force").unwrap(), [2.0, 3000.0]);
    assert_eq!(table.lines, [4, 6]);
    assert!(table.column("note").is_none());
}

#[test]
fn an_optional_column_that_is_spelt_otherwise_is_not_passed_over() {
    let wanted = [WANTED[0], Column::optional("angle", Dimension::Angle)];
    let read = |head: &str| {
        parse(
            &format!("displacement [mm],{head}\n1,2\n"),
            "t.csv",
            &wanted,
        )
    };
    for head in [
        "Angle [deg]",
        "ANGLE [deg]",
        "angle (of the frame)",
        "angle_1 [deg]",
        "Angles [deg]",
    ] {
        let e = read(head).unwrap_err();
        assert!(
            e.starts_with("t.csv:1:") && e.contains("did you mean `angle ["),
            "{e}"
        );
    }
    assert!(read("angle [deg]").unwrap().column("angle").is_some());
    assert!(read("force [N]").unwrap().column("angle").is_none());
}

#[test]
fn a_missing_column_is_named_with_those_there_are() {
    let e = error("displacement [mm],load [N]\n1,2\n");
    assert!(
        e.starts_with("t.csv:1: there is no column 'force'") && e.contains("displacement, load"),
        "{e}"
    );
}

#[test]
fn a_wrong_an_unknown_and_a_missing_unit_are_located() {
    let e = error("# c\ndisplacement [N],force [N]\n1,2\n");
    assert!(
        e.starts_with("t.csv:2: column 'displacement': the unit 'N' does not fit"),
        "{e}"
    );
    let e = error("displacement [mm],force [bananas]\n1,2\n");
    assert!(e.contains("bananas"), "{e}");
    let e = error("displacement [mm],force\n1,2\n");
    assert!(e.contains("'force': has no unit"), "{e}");
    let e = error("displacement,force\n1,2\n");
    assert!(e.contains("names no units"), "{e}");
}

#[test]
fn what_is_no_finite_number_is_located() {
    for bad in ["NaN", "inf", "abc", "", "1.2.3"] {
        let e = error(&format!("displacement [mm],force [N]\n1,2\n3,{bad}\n"));
        assert!(e.starts_with("t.csv:3: column 'force'"), "{e}");
    }
}

#[test]
fn a_row_of_another_length_is_located() {
    let e = error("displacement [mm],force [N]\n1,2\n1,5,2\n");
    assert!(e.starts_with("t.csv:3: 3 values"), "{e}");
}

#[test]
fn the_dialects_of_the_field_give_the_same_table() {
    let same = parse(
        "displacement [mm],force [N]\n0.5,-1.25\n10,1500\n",
        "t.csv",
        &WANTED,
    )
    .unwrap();
    for text in [
        "displacement [mm];force [N]\n0,5;-1,25\n10;1500\n",
        "# c; d\ndisplacement [mm]\tforce [N]\n0.5\t-1.25\n10\t1.5E+03\n",
        "displacement [mm]|force [N]\n0.5|-1.25\n10|1500\n",
        "\"displacement [mm]\",\"force [N]\"\n\"0,5\",\"-1,25\"\n\"10\",\"1500\"\n",
        "sep=;\nforce [kN];displacement [cm]\n-0.00125;0.05\n1.5;1\n",
        "\"force\n[N]\",displacement (mm)\n-1.25,0.5\n\n1500,10\n",
        "displacement,force\nmm,N\n0.5,-1.25\n10,1500\n",
        "displacement;force;note\n[mm];[N];\n0,5;-1,25;a\n10;1500;b, c\n;;\n",
        "displacement / mm,force / N\n0.5,\u{2212}1.25\n10,1500\n",
        "displacement [mm],force [N],,\n0.5,-1.25,,\n10,1500,,\n,,,\n",
        "displacement [mm],force [N],\"remark (first, of two)\"\n0.5,-1.25,\"a,b\"\n10,1500,c\n",
        "\"# made by \"\"A\"\", 2020\"\ndisplacement [mm],force [N]\n0.5,-1.25\n\"#x,y\"\n10,1.5D3\n",
    ] {
        let mark = "\u{feff}".to_owned() + text;
        let wide: Vec<u8> = mark.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let mac = text.replace('\n', "\r");
        let windows = mark.replace('\n', "\r\n");
        for bytes in [
            text.as_bytes(),
            mark.as_bytes(),
            &wide,
            mac.as_bytes(),
            windows.as_bytes(),
        ] {
            let read = parse(bytes, "t.csv", &WANTED).unwrap_or_else(|e| panic!("{e}\n{text}"));
            for name in ["displacement", "force"] {
                assert_eq!(read.column(name), same.column(name), "{text}");
            }
        }
    }
    // Latin-1: the signs of degrees and of micrometres.
    let latin = b"angle [\xb0],width [\xb5m]\n1.5,2\n";
    let wanted = [
        Column::required("angle", Dimension::Angle),
        Column::required("width", Dimension::Length),
    ];
    let read = parse(latin, "t.csv", &wanted).unwrap();
    assert_eq!(read.values("angle").unwrap(), [1.5f64.to_radians()]);
    assert_eq!(read.values("width").unwrap(), [2e-6]);
    // One column: a comma is no separator.
    let read = parse("displacement [mm]\n0,5\n", "t.csv", &WANTED[..1]).unwrap();
    assert_eq!(read.values("displacement").unwrap(), [0.0005]);
}

#[test]
fn what_a_comma_means_is_never_guessed() {
    for (text, says) in [
        (
            "displacement [mm],force [N]\n1,0,2,5\n",
            "t.csv:2: 4 values where the header names 2",
        ),
        (
            "displacement [mm];force [N]\n1;1,234\n2;2,345\n",
            "t.csv:2: the comma of `1,234` may be",
        ),
        (
            "displacement [mm];force [N]\n0.5;1,234\n",
            "t.csv:2: `1,234` has a comma",
        ),
        (
            "displacement [mm];force [N]\n0,5;1\n1.5;2\n",
            "t.csv:2: `0,5` has a comma",
        ),
        (
            "displacement [mm];force [N]\n0,5;1.234,5\n",
            "t.csv:2: column 'force': '1.234,5' is not a number",
        ),
        (
            "displacement [mm],force [N],note\n1,2,\"a\n3,4,b\n5,6,\"c\n",
            "t.csv:2: a quotation mark is not closed",
        ),
    ] {
        let e = error(text);
        assert!(e.starts_with(says), "{e}");
    }
}

#[test]
fn units_of_another_system_are_read_and_hints_have_the_right_dimension() {
    let table = parse("displacement [in],force [lbf]\n0.5,10\n", "t.csv", &WANTED).unwrap();
    assert_eq!(table.values("displacement").unwrap(), [0.0127]);
    assert_eq!(table.values("force").unwrap(), [44.482216152605]);
    for (unit, says) in [
        ("gg", "unknown unit `gg`: did you mean `gf`?"),
        ("lbs", "unknown unit `lbs`"),
        (
            "kg",
            "the unit 'kg' does not fit: it is a mass (as a force write `kgf`",
        ),
        ("dyn", "unknown unit `dyn`: write N: 1 dyn = 1e-5 N"),
    ] {
        let e = error(&format!("displacement [mm],force [{unit}]\n1,2\n"));
        assert!(
            e.starts_with(&format!("t.csv:1: column 'force': {says}")),
            "{e}"
        );
    }
}

#[test]
fn messages_are_short_and_harmless_whatever_is_in_the_file() {
    let long = "\u{1b}[2Jx".repeat(2_000_000);
    for text in [
        long.clone(),
        format!("displacement [mm],force [{long}]\n1,2\n"),
        format!("displacement [mm],{long} [N]\n1,2\n"),
        format!("displacement [mm],force [N]\n1,{long}\n"),
        format!("displacement [mm],force [N],{long}\n1,2\n"),
    ] {
        let e = error(&text);
        assert!(
            e.len() < 900 && !e.contains('\u{1b}'),
            "{} {}",
            e.len(),
            &e[..80]
        );
    }
}

#[test]
fn a_length_that_is_not_plausible_is_told_with_the_unit_of_its_column() {
    let table = |text: &str| parse(text, "t.csv", &WANTED[..1]).unwrap();
    let judge = |t: Table| t.plausible_length("displacement", [1e-3, 2.0], "a strip");
    assert!(judge(table("displacement [mm]\n1\n-2000\n")).is_ok());
    for (text, says) in [
        (
            "displacement [m]\n1\n97.0\n",
            "t.csv:3: column 'displacement [m]': 97 m",
        ),
        ("displacement [mm]\n0.097\n", "expected 1 mm to 2 m"),
    ] {
        let e = judge(table(text)).unwrap_err();
        assert!(e.contains(says) && e.contains("for a strip"), "{e}");
    }
}

#[test]
fn an_empty_file_says_what_is_expected() {
    let e = error("# nothing\n");
    assert!(e.contains("displacement [mm],force [N]"), "{e}");
}
