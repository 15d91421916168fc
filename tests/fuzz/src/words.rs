//! Words that formats know: keys and values of the schemas, units, and what stands between them.

use crate::fixture::{CATALOG, REPOSITORY, files};
use plyflow_model::manifest::PluginKind;
use plyflow_model::schema;
use plyflow_workflow::Catalog;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Write;

const VALUES: [&str; 50] = [
    "8 mm",
    "0.4 mm",
    "1e-3 m",
    "3 GPa",
    "112.19 N/m",
    "45 deg",
    "-45 deg",
    "0.1 rad",
    "440 g/m2",
    "1 bar",
    "20 kPa",
    "5 ms",
    "30 min",
    "4 GiB",
    "0.35",
    "1e308",
    "-1e-320",
    "18446744073709551616",
    "-9223372036854775808",
    "1/s",
    "kg/m3",
    "N m",
    "1/m",
    "20 °C",
    "293 K",
    "50 %",
    "5 in",
    "µm",
    "m^-2",
    "true",
    "null",
    "~",
    "[]",
    "{}",
    "&a",
    "*a",
    "<<: *a",
    "!!str",
    "|",
    ">-",
    "---",
    "'",
    "\"",
    "${angle}",
    "$${",
    "scene.yaml",
    "film.yaml",
    "points.csv",
    "tool.stl",
    "\u{feff}",
];

const CELLS: [&str; 16] = [
    "sep=;",
    "[mm]",
    "[N]",
    "(deg)",
    " / mm",
    "x [mm]",
    "displacement [mm]",
    "force [N]",
    "\t",
    ";",
    "1,5",
    "1.234,5",
    "1.0D+02",
    "nan",
    "\u{2212}3",
    "\r\n",
];

const STL: [&str; 14] = [
    "solid",
    "endsolid",
    "facet normal",
    "outer loop",
    "vertex",
    "endloop",
    "endfacet",
    "color",
    "/*",
    "*/",
    "1,5",
    "1e38",
    "-nan",
    "end loop",
];

const BOOK: [&str; 16] = [
    "name",
    "angle",
    "material",
    "outline",
    "layer",
    "x [mm]",
    "y [mm]",
    "rotation",
    "note",
    "ply.dxf",
    "corners.csv",
    "woven",
    "45 deg",
    "90",
    "0.5 rad",
    "PLY",
];

const DXF: [&str; 34] = [
    "SECTION",
    "ENDSEC",
    "HEADER",
    "$INSUNITS",
    "BLOCKS",
    "BLOCK",
    "ENDBLK",
    "ENTITIES",
    "EOF",
    "INSERT",
    "LINE",
    "ARC",
    "CIRCLE",
    "ELLIPSE",
    "SPLINE",
    "LWPOLYLINE",
    "POLYLINE",
    "VERTEX",
    "SEQEND",
    "REGION",
    "TEXT",
    "PLY",
    "  0\n",
    " 10\n",
    " 20\n",
    " 40\n",
    " 42\n",
    " 50\n",
    " 70\n",
    "230\n",
    "-1\n",
    "1e6\n",
    "x [mm],y [mm]",
    "contour",
];

const EXPRESSIONS: [&str; 24] = [
    "${angle}", "${mu}", "${layup}", "${on}", " and ", " or ", "not ", "min(", "max(", "abs(",
    "sqrt(", "sin(", "<=", ">=", "==", "!=", " deg", " N/m", " m^-2", "^", "(", ")", "'L4'",
    "1e-400",
];

/// Keys and texts of a JSON value; what is said of them in prose is left out.
fn collect(value: &Value, into: &mut BTreeSet<String>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                into.insert(key.clone());
                if !["description", "doc", "title", "summary"].contains(&key.as_str()) {
                    collect(value, into);
                }
            }
        }
        Value::Array(items) => items.iter().for_each(|v| collect(v, into)),
        Value::String(text) if text.len() <= 40 => drop(into.insert(text.clone())),
        _ => {}
    }
}

/// Words for a target, sorted.
#[must_use]
pub fn of(target: &str) -> Vec<String> {
    let mut words = BTreeSet::new();
    let mut add = |list: &[&str]| words.extend(list.iter().map(|w| (*w).to_owned()));
    match target {
        "table" | "profile" | "scan-points" | "points" => add(&CELLS),
        "stl" | "scan-facets" => add(&STL),
        "ply-book" => add(&[&CELLS[..], &BOOK].concat()),
        "drawing" => add(&[&CELLS[..], &DXF].concat()),
        "steering" => add(&[&CELLS[..], &["angle", "direction", "deg", "rad"]].concat()),
        "expression" => add(&EXPRESSIONS),
        _ => {}
    }
    match target {
        "workflow" | "scene" | "material" | "expected" | "override" | "quantity" | "expression"
        | "points" | "manifest" => {
            add(&VALUES);
        }
        _ => {}
    }
    let schema = match target {
        "workflow" | "override" => Some(schema::workflow()),
        "scene" => Some(schema::scene()),
        "material" => Some(schema::material()),
        "expected" => Some(schema::expected()),
        _ => None,
    };
    if let Some(schema) = schema {
        collect(&schema, &mut words);
        for kind in [PluginKind::Step, PluginKind::Element, PluginKind::Material] {
            words.extend(CATALOG.names(kind));
        }
    }
    let examples = match target {
        "manifest" | "plugins" | "workflow" | "override" | "material" => {
            files("solver-plugins", "manifest.json")
        }
        "record" => vec![REPOSITORY.join("tests/fuzz/fixture/record.json")],
        _ => Vec::new(),
    };
    for file in examples {
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        collect(&serde_json::from_str(&text).unwrap_or_default(), &mut words);
    }
    words.into_iter().filter(|w| !w.is_empty()).collect()
}

/// Words in the form of libFuzzer's dictionaries: one a line, in quotes.
#[must_use]
pub fn dictionary(words: &[String]) -> String {
    let mut out = String::new();
    for word in words {
        out.push('"');
        for b in word.bytes() {
            match b {
                b'"' | b'\\' => write!(out, "\\{}", char::from(b)),
                b' '..=b'~' => write!(out, "{}", char::from(b)),
                other => write!(out, "\\x{other:02x}"),
            }
            .expect("texts grow");
        }
        out.push_str("\"\n");
    }
    out
}
