//! Units: reading, refusing, writing.

use plyflow_model::units::*;
use proptest::prelude::*;

fn read(text: &str, d: Dimension) -> f64 {
    parse_quantity(text, d).unwrap_or_else(|e| panic!("{text}: {e}"))
}

#[test]
fn quantities_of_the_issue_are_read() {
    use Dimension::*;
    for (text, d, si) in [
        ("5 mm", Length, 0.005),
        ("5mm", Length, 0.005),
        ("1 bar", Pressure, 1e5),
        ("1e5 Pa", Pressure, 1e5),
        ("3 GPa", Pressure, 3e9),
        ("2 N/mm2", Pressure, 2e6),
        ("2 N/mm^2", Pressure, 2e6),
        ("2 N/mm²", Pressure, 2e6),
        ("2 N mm^-2", Pressure, 2e6),
        ("2 N mm⁻²", Pressure, 2e6),
        ("440 g/m2", ArealMass, 0.44),
        ("112.19 N/m", ForcePerLength, 112.19),
        ("0.19457 N mm", Moment, 0.19457e-3),
        ("0.19457 N*mm", Moment, 0.19457e-3),
        ("0.19457 N.mm", Moment, 0.19457e-3),
        ("0.19457 N·mm", Moment, 0.19457e-3),
        ("0.19457 N mm2/mm", Moment, 0.19457e-3),
        ("0.004 1/mm", Curvature, 4.0),
        ("4/m", Curvature, 4.0),
        ("4 m-1", Curvature, 4.0),
        ("8 deg", Angle, 8f64.to_radians()),
        ("-45 deg", Angle, (-45f64).to_radians()),
        ("-45°", Angle, (-45f64).to_radians()),
        ("0.5 rad", Angle, 0.5),
        ("20 ms", Time, 0.02),
        ("20 µs", Time, 2e-5),
        ("20 us", Time, 2e-5),
        ("30 min", Time, 1800.0),
        ("1.5 h", Time, 5400.0),
        ("0.7 h", Time, 2520.0),
        ("1.2 g/cm3", Density, 1200.0),
        ("1 t", Mass, 1000.0),
        ("20 degC", Temperature, 293.15),
        ("300 K", Temperature, 300.0),
        ("50 kHz", Frequency, 5e4),
        ("9.81 m/s2", Acceleration, 9.81),
        ("36 km/h", Velocity, 10.0),
        ("2 mJ", Energy, 0.002),
        ("20 cm2", Area, 0.002),
        ("1 l", Volume, 0.001),
        ("0.35", Dimensionless, 0.35),
        ("35 %", Dimensionless, 0.35),
        ("+.5 m", Length, 0.5),
        ("5. m", Length, 5.0),
        ("0 mm", Length, 0.0),
    ] {
        assert_eq!(read(text, d), si, "{text}");
    }
}

#[test]
fn minus_zero_is_zero_so_that_it_has_one_key() {
    assert_eq!(read("-0 mm", Dimension::Length).to_bits(), 0f64.to_bits());
}

#[test]
fn a_bare_number_is_an_error_that_names_the_missing_unit() {
    for text in ["5", "0", "5.0", "-1e3"] {
        let e = parse_quantity(text, Dimension::Length).unwrap_err();
        assert!(matches!(e, UnitError::MissingUnit { .. }), "{text}: {e}");
        assert!(
            e.to_string().contains("expected a length such as `5 mm`"),
            "{e}"
        );
        assert_eq!(
            e.help(),
            format!("write the unit after the number, such as `{text} mm`")
        );
    }
}

#[test]
fn a_wrong_dimension_says_what_it_got_and_what_it_expected() {
    let e = parse_quantity("5 mm", Dimension::Time).unwrap_err();
    assert_eq!(
        e.to_string(),
        "`5 mm` is a length; expected a time such as `20 ms`"
    );
    let e = parse_quantity("5 N/m3", Dimension::Time).unwrap_err();
    assert!(e.to_string().contains("a quantity in m^-2 kg s^-2"), "{e}");
    // An angle is no plain number and no length per length.
    assert!(parse_quantity("8 deg", Dimension::Dimensionless).is_err());
    assert!(parse_quantity("8 mm/mm", Dimension::Angle).is_err());
    assert!(parse_quantity("8 rad/s", Dimension::Frequency).is_err());
}

#[test]
fn an_unknown_unit_suggests_the_nearest_of_the_wanted_dimension() {
    for (text, d, nearest) in [
        ("5 Mpa", Dimension::Pressure, "MPa"),
        ("5 mpa", Dimension::Pressure, "mPa"),
        ("5 sec", Dimension::Time, "s"),
        ("8 degrees", Dimension::Angle, "deg"),
        ("8 dge", Dimension::Angle, "deg"),
        ("5 KN", Dimension::Force, "kN"),
        ("5 mmm", Dimension::Length, "mm"),
    ] {
        match parse_quantity(text, d).unwrap_err() {
            UnitError::UnknownUnit {
                nearest: Some(n), ..
            } => assert_eq!(n, nearest, "{text}"),
            e => panic!("{text}: {e:?}"),
        }
    }
    let e = parse_quantity("5 parsec", Dimension::Length).unwrap_err();
    assert!(
        matches!(e, UnitError::UnknownUnit { nearest: None, .. }),
        "{e:?}"
    );
}

#[test]
fn units_of_another_system_are_read_exactly() {
    use Dimension::*;
    for (text, d, same) in [
        ("0.25 in", Length, "6.35 mm"),
        ("1 inch", Length, "2.54 cm"),
        ("3 ft", Length, "914.4 mm"),
        ("5 mil", Length, "127 um"),
        ("2 yd", Length, "1828.8 mm"),
        ("1 in2", Area, "645.16 mm2"),
        ("2 lb", Mass, "907.18474 g"),
        ("16 oz", Mass, "453.59237 g"),
        ("10 lbf", Force, "44.482216152605 N"),
        ("1 ozf", Force, "0.27801385095378125 N"),
        ("1 kgf", Force, "9.80665 N"),
        ("20 gf", Force, "196.133 mN"),
        ("1 atm", Pressure, "1.01325 bar"),
        ("25 mmHg", Pressure, "3333.059685375 Pa"),
    ] {
        assert_eq!(read(text, d).to_bits(), read(same, d).to_bits(), "{text}");
    }
    for (text, d, si) in [
        ("14.5 psi", Pressure, 99973.98),
        ("2 ksi", Pressure, 13789514.59),
        ("1 lbf/in2", Pressure, 6894.757293168362),
        ("1 lbf/in", ForcePerLength, 175.126835246),
        ("10 oz/yd2", ArealMass, 0.3390574747),
        ("25 inHg", Pressure, 84659.716),
        ("1 lbf in", Moment, 0.1129848290),
        ("0.1 1/in", Curvature, 3.937007874),
    ] {
        assert!(
            (read(text, d) / si - 1.0).abs() < 1e-7,
            "{text}: {}",
            read(text, d)
        );
    }
}

#[test]
fn what_is_offered_has_the_wanted_dimension() {
    use Dimension::*;
    for (text, d, help) in [
        ("5 inches", Length, "did you mean `in`?"),
        ("5 \"", Length, "did you mean `in`?"),
        ("5 lbff", Force, "did you mean `lbf`?"),
        ("5 PSI", Pressure, "did you mean `psi`?"),
        (
            "60 degF",
            Temperature,
            "write degC: 32 degF = 0 degC, and 1.8 degF more are 1 degC more",
        ),
        ("5 dyn", Force, "write N: 1 dyn = 1e-5 N"),
        ("5 kg", Force, "as a force write `N`, `kgf` (9.80665 N)"),
    ] {
        let e = parse_quantity(text, d).unwrap_err();
        assert!(e.help().starts_with(help), "{text}: {}", e.help());
    }
    // Whatever the slip, and in whatever place, of whatever dimension.
    let words = [
        "inn", "mim", "mn", "gg", "kgg", "sec", "hz", "degf", "tt", "hh", "lbs", "ib", "pound",
        "oxz", "pas", "bra", "jj", "celsius",
    ];
    for d in Dimension::ALL {
        for word in words {
            for whole in [
                word.to_owned(),
                format!("N/{word}"),
                format!("{word}/m2"),
                format!("1/{word}"),
            ] {
                let Err(e) = parse_quantity(&format!("1 {whole}"), d) else {
                    continue;
                };
                let column = parse_unit_of(&whole, d).unwrap_err();
                assert_eq!(column.help(), e.help(), "{whole}");
                if let UnitError::UnknownUnit {
                    nearest: Some(n),
                    unit,
                    ..
                } = e
                {
                    let meant = whole.replacen(&unit, &n, 1);
                    assert!(parse_unit_of(&meant, d).is_ok(), "{whole} as {d}: {n}");
                }
            }
        }
    }
}

#[test]
fn a_comma_in_a_number_is_told_with_what_to_write() {
    for (text, help) in [
        ("5,5 mm", "write `5.5 mm`"),
        ("-0,250 mm", "write `-0.250 mm`"),
        ("1,500 mm", "write `1.500 mm` or `1500 mm`"),
        ("1,234.5 mm", "write `1234.5 mm`"),
        ("1,234,567 mm", "write `1234567 mm`"),
    ] {
        let e = parse_quantity(text, Dimension::Length).unwrap_err();
        let says = format!("`{text}` has a comma in its number");
        assert_eq!(e.reason(), says);
        assert!(
            e.to_string().contains("expected a length such as `5 mm`"),
            "{e}"
        );
        assert!(e.help().ends_with(help), "{text}: {}", e.help());
    }
    // A comma elsewhere is no part of a number.
    let e = parse_quantity("5 mm,", Dimension::Length).unwrap_err();
    assert!(matches!(e, UnitError::UnknownUnit { .. }), "{e}");
}

#[test]
fn what_is_meant_by_a_plain_number_with_per_cent_or_comma_is_known() {
    for (text, meant) in [
        ("1 %", Some("0.01")),
        ("12.5%", Some("0.125")),
        ("0,5", Some("0.5")),
        ("1,5 %", Some("0.015")),
        ("1,000", None),
        ("0.5 N", None),
        ("half", None),
    ] {
        assert_eq!(plain_number(text).as_deref(), meant, "{text}");
    }
}

#[test]
fn garbage_is_refused() {
    for text in [
        "",
        " ",
        "mm",
        "five mm",
        "5 5 mm",
        "5 mm mm mm mm mm mm mm2 mm9",
        "5 mm/",
        "5 /",
        "5 *mm",
        "5 m*",
        "5 m**2",
        "5 m^",
        "5 m0",
        "--5 mm",
        "inf m",
        "nan m",
        "0x5 m",
        "1,5 mm",
        "5 mm 1",
        "1e999 m",
        "5 m·",
        "5 1",
        "5 1 mm",
        "5 ²",
        "5 m⁻",
    ] {
        assert!(parse_quantity(text, Dimension::Length).is_err(), "`{text}`");
    }
}

#[test]
fn serde_reads_text_and_refuses_numbers() {
    let l: Length = serde_json::from_str("\"5 mm\"").unwrap();
    assert_eq!(l, Length(0.005));
    assert_eq!(serde_json::to_string(&l).unwrap(), "\"0.005 m\"");
    for number in ["5", "0", "-5", "0.5"] {
        let e = serde_json::from_str::<Length>(number)
            .unwrap_err()
            .to_string();
        assert!(e.contains("has no unit") && e.contains("5 mm"), "{e}");
    }
    assert!(serde_json::from_str::<Number>("\"0.3\"").is_err());
    assert_eq!(serde_json::from_str::<Number>("3").unwrap(), Number(3.0));
    assert!(serde_json::to_string(&Length(f64::NAN)).is_err());
}

#[test]
fn every_dimension_reads_its_own_example_and_base_unit() {
    for d in Dimension::ALL {
        read(d.example(), d);
        assert_eq!(read(&si_text(2.5, d), d), 2.5, "{d}");
    }
}

proptest! {
    #[test]
    fn millimetre_centimetre_and_metre_are_the_same_bits(
        digits in 0u64..10_000_000_000, places in 0usize..12
    ) {
        // The same decimal number with its point moved by hand.
        let shifted = |by: i32| format!("{digits}e{}", by - places as i32);
        let mm = read(&format!("{} mm", shifted(0)), Dimension::Length);
        prop_assert_eq!(mm.to_bits(), read(&format!("{} cm", shifted(-1)), Dimension::Length).to_bits());
        prop_assert_eq!(mm.to_bits(), read(&format!("{} m", shifted(-3)), Dimension::Length).to_bits());
        prop_assert_eq!(mm.to_bits(), read(&format!("{} um", shifted(3)), Dimension::Length).to_bits());
        prop_assert_eq!(mm.to_bits(), read(&format!("{} km", shifted(-6)), Dimension::Length).to_bits());
        let text: f64 = shifted(-3).parse().unwrap();
        prop_assert_eq!(mm.to_bits(), text.to_bits());
    }

    #[test]
    fn written_quantities_read_back_as_the_same_bits(value in proptest::num::f64::NORMAL) {
        let text = serde_json::to_string(&Pressure(value)).unwrap();
        let back: Pressure = serde_json::from_str(&text).unwrap();
        prop_assert_eq!(back.0.to_bits(), value.to_bits());
    }

    #[test]
    fn written_angles_read_back_as_the_same_bits(value in -10.0f64..10.0) {
        let back: Angle = si_text(value, Dimension::Angle).parse().unwrap();
        prop_assert_eq!(back.0.to_bits(), value.to_bits());
    }

    #[test]
    fn any_text_is_read_or_refused_without_panic(text in "\\PC{0,24}") {
        let _ = parse_quantity(&text, Dimension::Length);
        let _ = parse_unit(&text);
    }

    #[test]
    fn texts_of_unit_letters_do_not_panic(text in "[-+0-9eE. /*^²⁻mkgsNPaµ°%1]{0,24}") {
        let _ = parse_quantity(&text, Dimension::Pressure);
    }
}
