//! Tables of points as scanners and spreadsheets write them.

use plyflow_defects::scan::{Scan, read};
use std::fs;

/// 25 places in mm, no two coordinates of one alike.
fn places() -> Vec<[f64; 3]> {
    let each = 0..25;
    each.map(f64::from)
        .map(|i| [i + 0.25, 100.0 - 2.0 * i, 0.5 * i - 3.125])
        .collect()
}

/// A file whose rows are what `row` makes of a place.
fn file(head: &str, row: impl Fn(usize, [f64; 3]) -> String) -> String {
    let rows = places()
        .into_iter()
        .enumerate()
        .map(|(k, p)| row(k, p) + "\n");
    head.to_owned() + &rows.collect::<String>()
}

fn scan_of(bytes: &[u8], unit: Option<f64>) -> Result<Scan, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.csv");
    fs::write(&path, bytes).unwrap();
    read(&path, unit).map_err(|e| e.to_string())
}

fn assert_places(what: &str, bytes: &[u8], unit: Option<f64>, size: f64) {
    let scan = scan_of(bytes, unit).unwrap_or_else(|e| panic!("{what}: {e}"));
    assert_eq!(scan.points.len(), places().len(), "{what}");
    for (p, q) in scan.points.iter().zip(places()) {
        for d in 0..3 {
            assert!((p[d] - size * q[d]).abs() < 1e-12, "{what}: {p:?} {q:?}");
        }
    }
    assert!((scan.unit - size).abs() < 1e-15, "{what}");
}

#[test]
fn columns_are_those_that_the_header_names() {
    let mm = 0.001;
    let [comma, blank] =
        [",", " "].map(|s| move |p: [f64; 3]| format!("{}{s}{}{s}{}", p[0], p[1], p[2]));
    for (what, text) in [
        ("none", file("", |_, p| comma(p))),
        ("xyz", file("x,y,z\n", |_, p| comma(p))),
        ("yxz", file("y,x,z\n", |_, [x, y, z]| comma([y, x, z]))),
        (
            "zyx",
            file("Z;Y;X\n", |_, [x, y, z]| format!("{z};{y};{x}")),
        ),
        ("id", file("id,x,y,z\n", |k, p| format!("{k},{}", comma(p)))),
        (
            "id of words",
            file("id,x,y,z\n", |k, p| format!("P{k},{}", comma(p))),
        ),
        (
            "intensity",
            file("intensity,x,y,z\n", |_, p| format!("0.5,{}", comma(p))),
        ),
        (
            "row, col",
            file("row,col,x,y,z\n", |k, p| format!("{k},2,{}", comma(p))),
        ),
        (
            "behind",
            file("\"z\",\"nx\",\"y\",\"x\"\n", |_, [x, y, z]| {
                format!("{z},1,{y},{x}")
            }),
        ),
        ("units", file("x [mm],y [mm],z [mm]\n", |_, p| comma(p))),
        (
            "units of blanks",
            file("Y [mm] X [mm] Z [mm]\n", |_, [x, y, z]| blank([y, x, z])),
        ),
        (
            "suffix",
            file("y_mm,x_mm,z_mm\n", |_, [x, y, z]| comma([y, x, z])),
        ),
        (
            "row of units",
            file("y,x,z\n[mm],[mm],[mm]\n", |_, [x, y, z]| comma([y, x, z])),
        ),
        (
            "comment",
            file("# exported\n# y x z\n", |_, [x, y, z]| blank([y, x, z])),
        ),
        (
            "CloudCompare",
            file("//Y,X,Z,Intensity\n", |_, [x, y, z]| {
                format!("{},7", comma([y, x, z]))
            }),
        ),
        (
            "ParaView",
            file(
                "\"Points:1\",\"Points:0\",\"Points:2\"\n",
                |_, [x, y, z]| comma([y, x, z]),
            ),
        ),
        (
            "words",
            file(
                "Y Coordinate,X Coordinate,Z Coordinate\n",
                |_, [x, y, z]| comma([y, x, z]),
            ),
        ),
        (
            "header of other blanks",
            file("y x z\n", |_, [x, y, z]| comma([y, x, z])),
        ),
        (
            "sep",
            file("sep=;\ny;x;z\n", |_, [x, y, z]| format!("{y};{x};{z}")),
        ),
        (
            "a remark that has no names",
            file("# scan of x and z\n", |_, p| comma(p)),
        ),
    ] {
        assert_places(what, text.as_bytes(), None, mm);
        assert_places(what, text.as_bytes(), Some(mm), mm);
        let marked = ["\u{feff}", &text.replace('\n', "\r\n")].concat();
        assert_places(what, marked.as_bytes(), None, mm);
        let wide: Vec<u8> = marked.encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_places(what, &wide, None, mm);
    }
}

#[test]
fn numbers_are_read_as_every_country_writes_them() {
    let german = |v: f64| v.to_string().replace('.', ",");
    for (what, text) in [
        (
            "semicolons",
            file("x;y;z\n", |_, p| p.map(german).join(";")),
        ),
        ("no header", file("", |_, p| p.map(german).join(";"))),
        ("blanks", file("", |_, p| p.map(german).join(" "))),
        ("tabs", file("x\ty\tz\n", |_, p| p.map(german).join("\t"))),
        (
            "quotes",
            file("x,y,z\n", |_, p| {
                format!("\"{}\"", p.map(german).join("\",\""))
            }),
        ),
        (
            "power",
            file("", |_, p| {
                p.map(|v| format!("{v:e}").replace('e', "D")).join("  ")
            }),
        ),
        (
            "aligned",
            file("", |_, p| p.map(|v| format!("\t {v:9.4}")).join("\t")),
        ),
        (
            "comma and blank",
            file("", |_, p| p.map(|v| v.to_string()).join(", ")),
        ),
        (
            "more behind",
            file("", |k, p| {
                p.map(|v| v.to_string()).join(" ") + if k % 2 == 0 { " 255 0" } else { "" }
            }),
        ),
    ] {
        assert_places(what, text.as_bytes(), None, 0.001);
    }
}

#[test]
fn units_of_the_header_count_and_must_not_contradict_the_step() {
    let row = |_: usize, p: [f64; 3]| format!("{},{},{}", p[0], p[1], p[2]);
    for (head, unit) in [
        ("x [m],y [m],z [m]\n", 1.0),
        ("x (in),y (in),z (in)\n", 0.0254),
        ("x / cm,y / cm,z / cm\n", 0.01),
    ] {
        let text = file(head, row);
        assert_places(head, text.as_bytes(), None, unit);
        let told = scan_of(text.as_bytes(), Some(0.001)).unwrap_err();
        assert!(
            told.contains("scan.csv:1: the header says that one unit is"),
            "{told}"
        );
    }
    assert_places("step", file("", row).as_bytes(), Some(0.01), 0.01);
}

#[test]
fn what_cannot_be_told_is_refused_with_its_line() {
    let row = |_: usize, p: [f64; 3]| format!("{},{},{}", p[0], p[1], p[2]);
    let with = |text: &str| file(text, row);
    for (text, says) in [
        (
            with("Hochwert,Rechtswert,Hoehe\n"),
            "scan.csv:1: the first line names columns, but not one each of x, y and z: Hochwert, Rechtswert, Hoehe",
        ),
        (with("x,x,z\n"), "scan.csv:1: the first line names columns"),
        (with("x [kg],y [kg],z [kg]\n"), "scan.csv:1: the unit `kg`"),
        (
            with("x [mm],y,z\n"),
            "some of the columns x, y, z have a unit",
        ),
        (
            with("id,x,y,z\n"),
            "scan.csv:2: `0.25,100,-3.125` has no number in each of the columns x, y, z of the 4",
        ),
        (
            with("x,y,z\n") + "1,2\n",
            "scan.csv:27: `1 2` has 2 values where line 2 has 3",
        ),
        (
            with("x,y,z\n") + "1,2,3,4\n",
            "scan.csv:27: `1 2 3 4` has 4 values where line 2 has 3",
        ),
        (
            with("x,y,z\n") + "1,nan,3\n",
            "scan.csv:27: `1 nan 3` has no finite number in each of its columns",
        ),
        (
            with("") + "next\n",
            "scan.csv:26: `next` has 1 values where line 1 has 3",
        ),
        (
            with("") + "1,2,\"3\n4,5,6\n",
            "scan.csv:26: a quotation mark is not closed",
        ),
        (
            file("x;y;z\n", |_, p| p.map(|v| v.to_string()).join(";")) + "1,5;2;3\n",
            "scan.csv:27: `1,5` has a comma",
        ),
        (
            file("x;y;z\n", |k, _| {
                format!("1,{:03};2,{:03};{k}", 100 + k, 200 + k)
            }),
            "scan.csv:2: the comma of `1,100` may be",
        ),
        (
            file("", |k, _| format!("1,{k},2,{k},3,{k}")),
            "no header, and 6 whole numbers between commas",
        ),
        (
            "25\n".to_owned() + &file("", |_, p| p.map(|v| v.to_string()).join(" ")),
            "scan.csv:1: `25` does not begin with three numbers",
        ),
        ("ply\nformat ascii 1.0\n".into(), "scan.csv:1: "),
        ("".into(), "has 0 points"),
    ] {
        for end in ["\n", "\r\n", "\r"] {
            let told = scan_of(text.replace('\n', end).as_bytes(), None).unwrap_err();
            assert!(told.contains(says), "{told}\nexpected {says}");
        }
    }
    let long = format!("{}\u{1b}[2J,1,2\n", "x".repeat(3_000_000));
    for text in [long.clone(), with("x,y,z\n") + &long] {
        let told = scan_of(text.as_bytes(), None).unwrap_err();
        assert!(
            told.len() < 700 && !told.contains('\u{1b}'),
            "{}",
            told.len()
        );
    }
    assert!(
        scan_of(b"x,y,z\n\0\x01\x02", None)
            .unwrap_err()
            .contains("no text")
    );
}
