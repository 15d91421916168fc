//! STL in the dialects of the field.

use plyflow_files::stl::{Corners, parse, write};
use proptest::prelude::*;

/// A tetrahedron with coordinates that single precision holds.
fn facets() -> Vec<Corners> {
    let p = [
        [0.0; 3],
        [10.5, 0.0, 0.0],
        [0.0, 8.25, 0.0],
        [1.5, 2.0, -6.125],
    ];
    [[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]]
        .map(|t| t.map(|i| p[i]))
        .to_vec()
}

fn solid(name: &str, facets: &[Corners]) -> String {
    let mut text = format!("solid {name}\n");
    for f in facets {
        text += "  facet normal 0 0 1\n    outer loop\n";
        for [x, y, z] in f {
            text += &format!("      vertex {x:.6} {y:.6} {z:.6}\n");
        }
        text += "    endloop\n  endfacet\n";
    }
    text + &format!("endsolid {name}\n")
}

fn read(text: &str) -> Vec<Corners> {
    parse(text.as_bytes())
        .unwrap_or_else(|e| panic!("{e:?}\n{text}"))
        .corners
}

fn refused(bytes: &[u8]) -> String {
    let error = parse(bytes).unwrap_err();
    error.of(std::path::Path::new("t.stl"))
}

#[test]
fn dialects_of_text_are_read() {
    let (all, plain) = (facets(), solid("tool", &facets()));
    let comma = |text: &str| text.replace('.', ",");
    for (what, text) in [
        ("plain", plain.clone()),
        ("unnamed", plain.replace(" tool", "")),
        ("end solid", plain.replace("endsolid", "end solid")),
        ("end loop", plain.replace("endloop", "end loop")),
        ("end facet", plain.replace("endfacet", "End Facet")),
        ("outerloop", plain.replace("outer loop", "outerloop")),
        ("capitals", plain.to_uppercase()),
        ("mark", format!("\u{feff}{plain}")),
        (
            "comment first",
            format!("# exported\n; by\n// a /*\n{plain}"),
        ),
        ("comment last", format!("{plain}; exported\n")),
        ("block comment", format!("/* a\nfacet */{plain}")),
        (
            "comment behind",
            plain.replace("outer loop", "outer loop # of three"),
        ),
        ("colour", plain.replace("  facet", "color 1 0 0.5\n  facet")),
        (
            "colour within",
            plain.replace("    outer", "    COLOR 1 0 1\n    outer"),
        ),
        ("decimal commas", comma(&plain)),
        (
            "commas and semicolons",
            comma(&plain).replace("000 ", "000; "),
        ),
        ("comma between", plain.replace("000 ", "000, ")),
        (
            "D",
            plain
                .replace("10.500000", "1.05D+01")
                .replace("8.250000", "0.825d1"),
        ),
        ("tabs", plain.replace(' ', "\t")),
        ("old Macs", plain.replace('\n', "\r")),
        ("Windows", plain.replace('\n', "\r\n")),
        ("one line", plain.replace('\n', " ")),
        (
            "a word a line",
            plain
                .replace("  facet", "\nfacet")
                .split(' ')
                .collect::<Vec<_>>()
                .join(" ")
                .replace("vertex ", "vertex\n"),
        ),
        ("no normals", plain.replace(" normal 0 0 1", "")),
        (
            "normals not numbers",
            plain.replace("0 0 1\n", "-1.#IND nan(ind) -nan\n"),
        ),
        ("Ctrl-Z", format!("{plain}\u{1a}")),
        ("zeros behind", format!("{plain}\0\0\0")),
        (
            "name of words",
            plain.replace("solid tool", "solid a facet of the solid, endloop"),
        ),
        (
            "no outer loop",
            plain
                .replace("    outer loop\n", "")
                .replace("    endloop\n", ""),
        ),
    ] {
        assert_eq!(read(&text), all, "{what}");
    }
    // Points and commas between: one word each.
    let words = plain
        .replace("000 0", "000,0")
        .replace("000 8", "000,8")
        .replace("000 2", "000,2")
        .replace("000 -6", "000,-6");
    assert_eq!(read(&words), all);
}

#[test]
fn all_solids_are_read_whatever_the_encoding_of_their_names() {
    let all = facets();
    let twice = [all.clone(), all.clone()].concat();
    let both = solid("base", &all) + "\n" + &solid("gr\u{f6}\u{df}e", &all);
    let latin: Vec<u8> = both.chars().map(|c| c as u8).collect();
    let japanese = [
        both.replace("gr\u{f6}\u{df}e", "").into_bytes(),
        solid("", &[]).replace("solid ", "solid \n").into_bytes(),
    ]
    .concat();
    let wide = |big: bool| -> Vec<u8> {
        let units = std::iter::once(0xfeff).chain(both.encode_utf16());
        units
            .flat_map(|u: u16| {
                if big {
                    u.to_be_bytes()
                } else {
                    u.to_le_bytes()
                }
            })
            .collect()
    };
    let shift_jis = [
        b"solid \x83\x5c\x83\x8a\n".to_vec(),
        both[11..].replace("gr\u{f6}\u{df}e", "b").into_bytes(),
    ]
    .concat();
    for bytes in [
        both.clone().into_bytes(),
        latin,
        japanese,
        wide(false),
        wide(true),
        shift_jis,
    ] {
        let read = parse(&bytes).unwrap();
        assert_eq!(read.corners, twice);
        assert_eq!(read.lines.len(), twice.len());
    }
    // The first solid without its end, as some write; and without a line end between two.
    let open = both.replacen("endsolid base\n", "", 1);
    assert_eq!(read(&open), twice);
    assert_eq!(read(&both.replace('\n', " ")), twice);
}

#[test]
fn binary_files_are_told_by_their_length_whatever_their_first_word() {
    let all = facets();
    let mut bytes = write(&all);
    for head in [
        &b"solid tool facet normal"[..],
        b"exported",
        "gr\u{f6}".as_bytes(),
    ] {
        bytes[..head.len()].copy_from_slice(head);
        let read = parse(&bytes).unwrap();
        assert_eq!(read.corners, all);
        assert_eq!(read.place(2), "facet 3");
        // Normals are not used.
        for k in 0..all.len() {
            bytes[84 + 50 * k..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
        }
        assert_eq!(parse(&bytes).unwrap().corners, all);
        let cut = refused(&bytes[..84 + 50 * 2 + 17]);
        assert!(
            cut.contains("it ends after 2 of the 4 facets that it announces"),
            "{cut}"
        );
        let more = refused(&[&bytes[..], &[1, 2]].concat());
        assert!(
            more.contains("announces 4 facets, and goes on for 2 bytes"),
            "{more}"
        );
        let mut wrong = bytes.clone();
        wrong[80] = 3;
        assert!(refused(&wrong).contains("announces 3 facets, and goes on for 50 bytes"));
        let mut nowhere = bytes.clone();
        nowhere[84 + 50 * 2 + 16..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
        assert!(refused(&nowhere).contains("facet 3 has a coordinate that is not a finite number"));
    }
}

#[test]
fn what_is_wrong_in_text_is_told_with_its_line() {
    let plain = solid("tool", &facets());
    for (text, says) in [
        (
            plain.replacen("0.000000", "abc", 1),
            "t.stl:4: a corner has three numbers",
        ),
        (
            plain.replacen("10.500000", "10.5.0", 1),
            "t.stl:5: a coordinate is no number: `10.5.0`",
        ),
        (
            plain.replacen("10.500000", "nan", 1),
            "t.stl:5: a coordinate is not a finite number: `nan`",
        ),
        (
            plain.replacen("10.500000", "-1.#INF", 1),
            "t.stl:5: a coordinate is not a finite number",
        ),
        (
            plain.replacen("10.500000", "1e999", 1),
            "t.stl:5: a coordinate is no number",
        ),
        (
            plain.replacen(" 0.000000\n", "\n", 1),
            "t.stl:4: a corner has three numbers; found `0.000000 0.000000`",
        ),
        (
            plain.replacen("      vertex 0.000000 0.000000 0.000000\n", "", 1),
            "t.stl:2: this facet has 2 corners",
        ),
        (
            plain.replacen("    endloop\n", "      vertex 1 2 3\n    endloop\n", 1),
            "t.stl:2: this facet has 4 corners",
        ),
        (
            plain.replacen("  endfacet\n", "", 1),
            "t.stl:8: expected the three corners of a facet and `endfacet`, found `facet`",
        ),
        (
            plain.replacen("endsolid tool\n", "", 1),
            ":29: it ends without `endsolid`, after 4 facets; it was cut off",
        ),
        (
            plain[..200].to_owned(),
            "t.stl:9: the file ends within this facet; it was cut off",
        ),
        (
            plain.replacen("solid tool\n", "", 1),
            "t.stl:1: expected `solid`, found `facet`",
        ),
        (
            format!("{plain}thank you\n"),
            "t.stl:31: expected `solid`, found `thank`",
        ),
        (
            plain.replacen("  facet", "  texture 1\n  facet", 1),
            "t.stl:2: expected `facet` or `endsolid`, found `texture`",
        ),
        (
            plain.replacen("10.500000", "10,5", 1),
            "t.stl:5: `10,5` has a comma",
        ),
        (
            plain.replacen("10.500000", "1,234", 1),
            "t.stl:5: `1,234` has a comma",
        ),
        ("solid a\nendsolid a\n".into(), "it has no facets"),
    ] {
        for end in ["\n", "\r\n", "\r"] {
            let told = refused(text.replace('\n', end).as_bytes());
            assert!(told.contains(says), "{told}\nexpected {says}");
        }
    }
}

#[test]
fn messages_are_short_and_harmless_whatever_is_in_the_file() {
    let plain = solid("tool", &facets());
    let long = "\u{1b}[2J".repeat(3_000_000);
    for text in [
        plain.replacen("10.500000", &long, 1),
        plain.replacen("endloop", &long, 1),
        format!("{plain}{long}"),
        format!("solid a\n{long}"),
    ] {
        let told = refused(text.as_bytes());
        assert!(
            told.len() < 600 && !told.contains('\u{1b}'),
            "{}",
            told.len()
        );
    }
}

#[test]
fn other_files_are_called_what_they_are() {
    for (bytes, says) in [
        (&b"ISO-10303-21;\nHEADER;\n"[..], "it is a STEP file"),
        (b"<!DOCTYPE html>", "HTML"),
        (b"PK\x03\x04....", "zip"),
        (b"ply\nformat ascii 1.0\n", "a PLY file"),
        (
            b"# object\nv 0 0 0\nf 1 2 3\n",
            "neither `solid` nor `facet`",
        ),
        (b"\x1f\x8b\x08", "a compressed file"),
        (b"", "it is empty"),
        (&[7; 90], "it ends after 0 of the 117901063 facets"),
    ] {
        let told = refused(bytes);
        assert!(told.contains(says), "{told}");
    }
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = parse(&bytes);
    }

    #[test]
    fn no_words_of_the_format_make_the_reader_panic(
        words in proptest::collection::vec("solid|endsolid|end|facet|normal|outer|loop|endloop|endfacet|vertex|color|1|2,5|1e5|nan|,|;|#|/\\*|\n|\r| |\u{f6}", 0..60)
    ) {
        let text = words.join(" ");
        if let Ok(facets) = parse(text.as_bytes()) {
            prop_assert_eq!(facets.corners.len(), text.matches("endfacet").count());
        }
    }
}
