//! DXF drawings as programs write them, and as they are damaged.

use plyflow_files::dxf::{Drawing, Fineness, Unit};
use plyflow_files::flaw::plain;
use plyflow_model::outline::{Region, sides, signed_area};
use std::fmt::Write;

const FINE: Fineness = Fineness {
    tolerance: 1e-5,
    chord: 5e-5,
};

/// A drawing of these entities, each as `CODE VALUE` in pairs of words.
fn drawing(unit: &str, blocks: &[&str], entities: &[&str]) -> String {
    let mut text =
        format!("999\nmade by hand\n0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n{unit}\n0\nENDSEC\n");
    let mut section = |name: &str, all: &[&str]| {
        write!(text, "0\nSECTION\n2\n{name}\n").unwrap();
        for word in all.iter().flat_map(|e| e.split(' ')) {
            writeln!(text, "{word}").unwrap();
        }
        text += "0\nENDSEC\n";
    };
    section("BLOCKS", blocks);
    section("ENTITIES", entities);
    text + "0\nEOF\n"
}

fn region(text: &str, layer: Option<&str>) -> Region {
    let read = || {
        let drawing = Drawing::read(text)?;
        let unit = drawing.unit_or(None)?;
        drawing.contours(layer, unit, FINE)
    };
    let found = read().unwrap_or_else(|f| panic!("{}", f.of("a.dxf", text)));
    Region::new(found.outline, found.holes).unwrap()
}

fn refused(text: &str, layer: Option<&str>) -> String {
    let read = || {
        let drawing = Drawing::read(text)?;
        let unit = drawing.unit_or(None)?;
        drawing.contours(layer, unit, FINE)
    };
    read().expect_err("it was read").of("a.dxf", text)
}

const SQUARE: &str = "0 LWPOLYLINE 8 PLY 90 4 70 1 10 0 20 0 10 200 20 0 10 200 20 100 10 0 20 100";

#[test]
fn corners_have_the_bits_of_a_scene_that_lists_them() {
    let square = region(&drawing("4", &[], &[SQUARE]), None);
    assert_eq!(
        square.outline,
        [[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.0, 0.1]]
    );
    let inches = region(&drawing("1", &[], &[SQUARE]), Some("ply"));
    assert_eq!(inches.outline[2], [5.08, 2.54]);
    assert_eq!(Unit::of(1e-3), Unit::Symbol("mm"));
    assert_eq!(Unit::of(0.0254), Unit::Symbol("in"));
    assert!(matches!(Unit::of(0.123), Unit::Metres(_)));
}

#[test]
fn lines_and_arcs_are_joined_whichever_way_they_run_and_what_lies_inside_is_a_hole() {
    // A slot of half circles, its parts in no order, one of them within the tolerance of the next.
    let text = drawing(
        "4",
        &[],
        &[
            "0 LINE 8 A 10 100 20 40 11 0 21 40",
            "0 ARC 8 A 10 0 20 20 40 20 50 90 51 270",
            "0 CIRCLE 8 A 10 50 20 20 40 5",
            "0 LINE 8 A 10 0.005 20 0 11 100 21 0",
            "0 ARC 8 A 10 100 20 20 40 20 50 270 51 90",
            "0 TEXT 8 A 10 1 20 1 40 5 1 words",
            "0 LINE 8 B 10 0 20 0 11 1 21 1",
        ],
    );
    let slot = region(&text, Some("A"));
    let circle = |r: f64| std::f64::consts::PI * r * r;
    let area = 0.1 * 0.04 + circle(0.02) - circle(0.005);
    assert!(
        (slot.area() - area).abs() < 2e-3 * area,
        "{} {area}",
        slot.area()
    );
    assert_eq!(slot.holes.len(), 1);
    // No side lies farther off the arcs than the chord says.
    for p in slot.outline.iter().filter(|p| p[0] > 0.1) {
        assert!(
            ((p[0] - 0.1).hypot(p[1] - 0.02) - 0.02).abs() < 1e-9,
            "{p:?}"
        );
    }
    let end = |p: [f64; 2]| p[0] >= 0.1 - 1e-9;
    let arc: Vec<_> = sides(&slot.outline)
        .filter(|(a, b)| end(*a) && end(*b))
        .collect();
    assert!(arc.len() > 20, "{}", arc.len());
    for (a, b) in arc {
        let off = 0.02 - (0.5 * (a[0] + b[0]) - 0.1).hypot(0.5 * (a[1] + b[1]) - 0.02);
        assert!(off < FINE.chord, "{off}");
    }
}

#[test]
fn bulges_ellipses_splines_and_old_polylines_bound_the_areas_that_they_should() {
    let pi = std::f64::consts::PI;
    // A circle of two half circles, one each way round.
    let bulged = "0 LWPOLYLINE 8 A 70 1 10 -10 20 0 42 1 10 10 20 0 42 1";
    let turned = "0 LWPOLYLINE 8 A 70 1 10 -10 20 0 42 -1 10 10 20 0 42 -1";
    let old = "0 POLYLINE 8 A 66 1 70 1 0 VERTEX 8 A 10 -10 20 0 42 1 0 VERTEX 8 A 10 10 20 0 42 1 0 SEQEND 8 A";
    let ellipse = "0 ELLIPSE 8 A 10 5 20 5 11 0 21 20 40 0.5 41 0 42 6.283185307179586";
    let half = [
        "0 ELLIPSE 8 A 10 0 20 0 11 20 21 0 40 0.5 41 0 42 3.141592653589793",
        "0 LINE 8 A 10 -20 20 0 11 20 21 0",
    ];
    // A circle of radius 10 as a rational quadratic, in a square of control points.
    let w = 0.5_f64.sqrt();
    let poles: String = [
        [10, 0],
        [10, 10],
        [0, 10],
        [-10, 10],
        [-10, 0],
        [-10, -10],
        [0, -10],
        [10, -10],
        [10, 0],
    ]
    .map(|[x, y]| format!(" 10 {x} 20 {y} 30 0"))
    .concat();
    let weights: String = (0..9)
        .map(|k| format!(" 41 {}", if k % 2 == 1 { w } else { 1.0 }))
        .collect();
    let knots: String = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
        .map(|k| format!(" 40 {k}"))
        .concat();
    let spline = format!("0 SPLINE 8 A 70 13 71 2 72 12 73 9{knots}{weights}{poles}");
    for (entities, area) in [
        (vec![bulged], 100.0 * pi),
        (vec![turned], 100.0 * pi),
        (vec![old], 100.0 * pi),
        (vec![ellipse], 200.0 * pi),
        (half.to_vec(), 100.0 * pi),
        (vec![spline.as_str()], 100.0 * pi),
    ] {
        let found = region(&drawing("4", &[], &entities), None).area() * 1e6;
        assert!(
            found < area && found > 0.98 * area,
            "{entities:?}: {found} {area}"
        );
        let centred = region(&drawing("4", &[], &entities), None).outline;
        assert!(centred.len() > 16 && signed_area(&centred) > 0.0);
    }
}

#[test]
fn blocks_are_put_in_their_places_turned_scaled_and_mirrored() {
    let block = [
        "0 BLOCK 2 Part 10 10 20 0 0 LINE 8 0 10 10 20 0 11 30 21 0 0 LINE 8 0 10 30 20 0 11 10 21 10 0 LINE 8 0 10 10 20 10 11 10 21 0 0 ENDBLK",
    ];
    let of = |insert: &str| {
        region(&drawing("4", &block, &[insert]), Some("PLY"))
            .bounds()
            .map(|v| (1e9 * v).round() / 1e6)
    };
    assert_eq!(
        of("0 INSERT 8 PLY 2 part 10 0 20 0"),
        [0.0, 0.0, 20.0, 10.0]
    );
    assert_eq!(
        of("0 INSERT 8 PLY 2 part 10 5 20 1 50 90"),
        [-5.0, 1.0, 5.0, 21.0]
    );
    assert_eq!(
        of("0 INSERT 8 PLY 2 part 10 0 20 0 41 2 42 0.5"),
        [0.0, 0.0, 40.0, 5.0]
    );
    assert_eq!(
        of("0 INSERT 8 PLY 2 part 10 100 20 0 230 -1"),
        [-120.0, 0.0, -100.0, 10.0]
    );
    let array = drawing(
        "4",
        &block,
        &[
            "0 INSERT 8 PLY 2 part 10 0 20 0 70 2 44 50",
            "0 LWPOLYLINE 8 PLY 70 1 10 -5 20 -5 10 90 20 -5 10 90 20 50 10 -5 20 50",
        ],
    );
    assert_eq!(region(&array, Some("PLY")).holes.len(), 2);
    let itself = ["0 BLOCK 2 A 10 0 20 0 0 INSERT 8 0 2 A 10 0 20 0 0 ENDBLK"];
    let told = refused(
        &drawing("4", &itself, &["0 INSERT 8 PLY 2 A 10 0 20 0"]),
        None,
    );
    assert!(told.contains("more than 8 deep"), "{told}");
    let told = refused(
        &drawing("4", &block, &["0 INSERT 8 PLY 2 gone 10 0 20 0"]),
        None,
    );
    assert!(told.contains("there is no block `gone`"), "{told}");
}

#[test]
fn what_is_no_outline_is_told_with_its_line() {
    let line = |text: &str, word: &str| text.lines().position(|l| l == word).unwrap() + 1;
    for (entities, word, says) in [
        (
            vec!["0 LINE 8 A 10 0 20 0 11 10 21 0"],
            "LINE",
            "the contour is open: the LINE that begins here ends at (0, 0) mm",
        ),
        (vec!["0 CIRCLE 8 A 10 0 20 0 40 x"], "x", "`x` is no number"),
        (
            vec!["0 CIRCLE 8 A 10 0 20 0 40 -1"],
            "CIRCLE",
            "has no radius",
        ),
        (
            vec!["0 CIRCLE 8 A 10 0 20 0 40 5", "0 REGION 8 A"],
            "REGION",
            "a REGION on the layer `A` is not read",
        ),
        (
            vec![
                "0 CIRCLE 8 A 10 0 20 0 40 5",
                "0 ARC 8 A 10 0 20 0 40 1 50 0 51 90 210 1",
            ],
            "ARC",
            "does not lie in the x-y plane",
        ),
        (
            vec!["0 LINE 8 A 10 0 20 0 30 0 11 10 21 0 31 5"],
            "LINE",
            "is not flat: its z spans 5 mm",
        ),
        (
            vec![
                "0 CIRCLE 8 A 10 0 20 0 40 5",
                "0 ARC 8 A 10 9 20 0 40 5 50 0 51 0",
            ],
            "ARC",
            "crosses or touches the largest one",
        ),
        (
            vec!["0 SPLINE 8 A 70 8 71 3 10 0 20 0"],
            "SPLINE",
            "is none: degree 3, 1 control points",
        ),
        (
            vec!["0 SPLINE 8 A 70 8 71 3 11 0 21 0"],
            "SPLINE",
            "has points that it goes through",
        ),
        (
            vec!["0 LWPOLYLINE 8 A 70 1 10 0 20 0 10 9 20 9 10 9 20 0 10 0 20 9"],
            "LWPOLYLINE",
            "crosses or touches itself at (4.5, 4.5) mm",
        ),
    ] {
        let text = drawing("4", &[], &entities);
        let told = refused(&text, None);
        assert!(told.contains(says), "{told}");
        assert!(
            told.starts_with(&format!("a.dxf:{}:1: ", line(&text, word))),
            "{told}"
        );
    }
    for (text, layer, says) in [
        (
            drawing("0", &[], &[SQUARE]),
            None,
            "does not say what its unit is",
        ),
        (drawing("3", &[], &[SQUARE]), None, "its $INSUNITS is 3"),
        (
            drawing("4", &[], &[SQUARE]),
            Some("GONE"),
            "there is no curve on the layer `GONE`; curves lie on `PLY`",
        ),
        (
            drawing("4", &[], &[SQUARE, "0 CIRCLE 8 B 10 0 20 0 40 1"]),
            None,
            "curves lie on 2 layers: `B`, `PLY`",
        ),
        (drawing("4", &[], &[]), None, "no curve in its model space"),
        (
            "solid x\n".into(),
            None,
            "a.dxf:1:1: `solid x` is no group code",
        ),
        (
            "0\nSECTION\n2\nENTITIES\n0\nCIRCLE\n8".into(),
            None,
            "it was cut off",
        ),
        (
            "0\nSECTION\n2\nENTITIES\n0\nCIRCLE\n".into(),
            None,
            "the section ENTITIES has no end",
        ),
        (String::new(), None, "no section ENTITIES"),
    ] {
        let told = refused(&text, layer);
        assert!(told.contains(says), "{told}");
    }
}

#[test]
fn the_drawing_that_comes_along_is_read() {
    let bytes = include_bytes!("../../../workflows/files-of-others/blank.dxf");
    let text = plain(bytes).unwrap();
    let drawing = Drawing::read(&text).unwrap();
    assert_eq!(drawing.layers().unwrap().len(), 1);
    let found = region(&text, Some("PLY"));
    assert_eq!(found.holes.len(), 1);
}

#[test]
fn a_drawing_that_is_damaged_is_refused_or_bounds_a_region() {
    let text = plain(include_bytes!(
        "../../../workflows/files-of-others/blank.dxf"
    ))
    .unwrap();
    // A generator of our own, so that a failure comes again.
    let mut state = 1_u64;
    let mut next = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as usize % below
    };
    let (mut read, mut wrong) = (0, 0);
    for _ in 0..300 {
        let mut lines: Vec<&str> = text.lines().collect();
        for _ in 0..=next(3) {
            let at = next(lines.len());
            match next(4) {
                0 => drop(lines.remove(at)),
                1 => lines.insert(at, ["0", "-1", "NaN", "1e999", "SECTION"][next(5)]),
                2 => lines.truncate(at.max(1)),
                _ => lines[at] = ["0", "10", "inf", "9223372036854775808", ""][next(5)],
            }
        }
        let damaged = lines.join("\n");
        let found =
            Drawing::read(&damaged).and_then(|d| d.contours(None, Unit::Symbol("mm"), FINE));
        match found {
            Ok(found) => {
                Region::new(found.outline, found.holes).unwrap();
                read += 1;
            }
            Err(flaw) => {
                assert!(flaw.place(&damaged).0 <= lines.len() + 1, "{flaw:?}");
                wrong += 1;
            }
        }
    }
    assert!(read > 0 && wrong > 0, "{read} {wrong}: all were the same");
}
