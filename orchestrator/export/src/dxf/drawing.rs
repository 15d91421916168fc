//! The text of a drawing: sections of pairs of a group code and a value.
//!
//! A reader asks for tables, two blocks and a dictionary even where nothing is in them. Handles are hexadecimal numbers that are used once.

use crate::request::LengthUnit;
use crate::vec3::Vec3;
use std::fmt::Write as _;

/// A drawing on the way.
pub struct Drawing {
    unit: LengthUnit,
    about: Vec<String>,
    layers: Vec<(String, u8)>,
    entities: String,
    next: u32,
}

/// A pair of a group code and a value.
fn pair(text: &mut String, code: u16, value: impl std::fmt::Display) {
    let _ = write!(text, "{code:>3}\n{value}\n");
}

/// Handles of what every drawing has.
mod handle {
    pub const TABLES: [u32; 9] = [0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x18, 0x19];
    pub const MODEL: u32 = 0x21;
    pub const PAPER: u32 = 0x22;
    pub const DICTIONARY: u32 = 0x31;
    pub const GROUPS: u32 = 0x32;
    pub const FIRST_FREE: u32 = 0x40;
}

impl Drawing {
    /// An empty one, in this unit, with comments at its head.
    pub fn new(unit: LengthUnit, about: &[String]) -> Self {
        Self {
            unit,
            about: about.to_vec(),
            layers: vec![("0".into(), 7)],
            entities: String::new(),
            next: handle::FIRST_FREE,
        }
    }

    fn handle(&mut self) -> String {
        self.next += 1;
        format!("{:X}", self.next - 1)
    }

    /// A new layer, with one of AutoCAD's numbers of colours.
    pub fn layer(&mut self, name: &str, colour: u8) -> usize {
        self.layers.push((name.to_owned(), colour));
        self.layers.len() - 1
    }

    fn begin(&mut self, kind: &str, layer: usize, class: &str) -> String {
        let handle = self.handle();
        let text = &mut self.entities;
        pair(text, 0, kind);
        pair(text, 5, &handle);
        pair(text, 330, format!("{:X}", handle::MODEL));
        pair(text, 100, "AcDbEntity");
        pair(text, 8, &self.layers[layer].0);
        pair(text, 100, class);
        handle
    }

    /// A closed line in the plane of the drawing.
    pub fn closed_plane(&mut self, layer: usize, points: &[Vec3]) {
        self.plane(layer, points, true);
    }

    /// An open line in the plane of the drawing, through these points.
    pub fn open_plane(&mut self, layer: usize, points: &[Vec3], straight: bool) {
        match points {
            // The ends are enough.
            [first, .., last] if straight => self.plane(layer, &[*first, *last], false),
            points => self.plane(layer, points, false),
        }
    }

    /// A line in the plane of the drawing.
    fn plane(&mut self, layer: usize, points: &[Vec3], closed: bool) {
        self.begin("LWPOLYLINE", layer, "AcDbPolyline");
        let text = &mut self.entities;
        pair(text, 90, points.len());
        pair(text, 70, u8::from(closed));
        for [x, y, _] in points {
            pair(text, 10, x);
            pair(text, 20, y);
        }
    }

    /// A line in space.
    pub fn line(&mut self, layer: usize, points: &[Vec3], closed: bool) {
        let owner = self.begin("POLYLINE", layer, "AcDb3dPolyline");
        let text = &mut self.entities;
        pair(text, 66, 1);
        for code in [10, 20, 30] {
            pair(text, code, 0);
        }
        pair(text, 70, 8 + u8::from(closed));
        let name = self.layers[layer].0.clone();
        let part = |drawing: &mut Self, kind: &str| {
            let handle = drawing.handle();
            let text = &mut drawing.entities;
            pair(text, 0, kind);
            pair(text, 5, handle);
            pair(text, 330, &owner);
            pair(text, 100, "AcDbEntity");
            pair(text, 8, &name);
        };
        for [x, y, z] in points {
            part(self, "VERTEX");
            let text = &mut self.entities;
            pair(text, 100, "AcDbVertex");
            pair(text, 100, "AcDb3dPolylineVertex");
            for (code, value) in [(10, x), (20, y), (30, z)] {
                pair(text, code, value);
            }
            pair(text, 70, 32);
        }
        part(self, "SEQEND");
    }

    /// Its text.
    pub fn finish(mut self) -> String {
        let layers = self.layer_records();
        let mut text = String::new();
        for line in &self.about {
            pair(&mut text, 999, line);
        }
        let body = [
            ("CLASSES", String::new()),
            ("TABLES", self.tables(&layers)),
            ("BLOCKS", self.blocks()),
            ("ENTITIES", std::mem::take(&mut self.entities)),
            ("OBJECTS", objects()),
        ];
        section(&mut text, "HEADER", &self.header());
        for (name, inner) in body {
            section(&mut text, name, &inner);
        }
        pair(&mut text, 0, "EOF");
        text
    }

    fn header(&self) -> String {
        let mut text = String::new();
        let units = match self.unit {
            LengthUnit::Inch => 1,
            LengthUnit::Millimetre => 4,
            LengthUnit::Metre => 6,
        };
        let metric = u8::from(units != 1);
        for (name, code, value) in [
            ("$ACADVER", 1, "AC1015".to_owned()),
            ("$HANDSEED", 5, format!("{:X}", self.next)),
            ("$INSUNITS", 70, units.to_string()),
            ("$MEASUREMENT", 70, metric.to_string()),
        ] {
            pair(&mut text, 9, name);
            pair(&mut text, code, value);
        }
        text
    }

    fn layer_records(&mut self) -> String {
        let mut text = String::new();
        for (name, colour) in self.layers.clone() {
            let handle = self.handle();
            record(
                &mut text,
                "LAYER",
                &handle,
                handle::TABLES[2],
                "AcDbLayerTableRecord",
                &name,
            );
            pair(&mut text, 62, colour);
            pair(&mut text, 6, "Continuous");
        }
        text
    }

    fn line_types(&mut self) -> String {
        let mut text = String::new();
        for name in ["ByBlock", "ByLayer", "Continuous"] {
            let handle = self.handle();
            let table = handle::TABLES[1];
            record(
                &mut text,
                "LTYPE",
                &handle,
                table,
                "AcDbLinetypeTableRecord",
                name,
            );
            pair(&mut text, 3, "");
            pair(&mut text, 72, 65);
            pair(&mut text, 73, 0);
            pair(&mut text, 40, 0);
        }
        text
    }

    fn text_style(&mut self) -> String {
        let mut text = String::new();
        let (handle, table) = (self.handle(), handle::TABLES[3]);
        record(
            &mut text,
            "STYLE",
            &handle,
            table,
            "AcDbTextStyleTableRecord",
            "Standard",
        );
        for (code, value) in [
            (40, "0"),
            (41, "1"),
            (50, "0"),
            (71, "0"),
            (42, "2.5"),
            (3, "txt"),
            (4, ""),
        ] {
            pair(&mut text, code, value);
        }
        text
    }

    /// The nine tables, most of them with what every drawing has to have.
    fn tables(&mut self, layers: &str) -> String {
        let (types, style) = (self.line_types(), self.text_style());
        let mut program = String::new();
        let (handle, table) = (self.handle(), handle::TABLES[6]);
        record(
            &mut program,
            "APPID",
            &handle,
            table,
            "AcDbRegAppTableRecord",
            "ACAD",
        );
        let blocks = block_records();
        let mut text = String::new();
        let records = [
            ("VPORT", 0, ""),
            ("LTYPE", 3, types.as_str()),
            ("LAYER", self.layers.len(), layers),
            ("STYLE", 1, style.as_str()),
            ("VIEW", 0, ""),
            ("UCS", 0, ""),
            ("APPID", 1, program.as_str()),
            ("DIMSTYLE", 0, ""),
            ("BLOCK_RECORD", 2, blocks.as_str()),
        ];
        for (at, (name, count, records)) in handle::TABLES.into_iter().zip(records) {
            pair(&mut text, 0, "TABLE");
            pair(&mut text, 2, name);
            pair(&mut text, 5, format!("{at:X}"));
            pair(&mut text, 330, 0);
            pair(&mut text, 100, "AcDbSymbolTable");
            pair(&mut text, 70, count);
            if name == "DIMSTYLE" {
                pair(&mut text, 100, "AcDbDimStyleTable");
            }
            text += records;
            pair(&mut text, 0, "ENDTAB");
        }
        text
    }

    fn blocks(&mut self) -> String {
        let mut text = String::new();
        for (at, name) in [
            (handle::MODEL, "*Model_Space"),
            (handle::PAPER, "*Paper_Space"),
        ] {
            for (kind, class) in [("BLOCK", "AcDbBlockBegin"), ("ENDBLK", "AcDbBlockEnd")] {
                pair(&mut text, 0, kind);
                pair(&mut text, 5, self.handle());
                pair(&mut text, 330, format!("{at:X}"));
                pair(&mut text, 100, "AcDbEntity");
                pair(&mut text, 8, 0);
                pair(&mut text, 100, class);
                if kind == "BLOCK" {
                    pair(&mut text, 2, name);
                    pair(&mut text, 70, 0);
                    for code in [10, 20, 30] {
                        pair(&mut text, code, 0);
                    }
                    pair(&mut text, 3, name);
                    pair(&mut text, 1, "");
                }
            }
        }
        text
    }
}

/// Records of the two blocks that every drawing has.
fn block_records() -> String {
    let mut text = String::new();
    for (at, name) in [
        (handle::MODEL, "*Model_Space"),
        (handle::PAPER, "*Paper_Space"),
    ] {
        pair(&mut text, 0, "BLOCK_RECORD");
        pair(&mut text, 5, format!("{at:X}"));
        pair(&mut text, 330, format!("{:X}", handle::TABLES[8]));
        pair(&mut text, 100, "AcDbSymbolTableRecord");
        pair(&mut text, 100, "AcDbBlockTableRecord");
        pair(&mut text, 2, name);
    }
    text
}

fn section(text: &mut String, name: &str, inner: &str) {
    pair(text, 0, "SECTION");
    pair(text, 2, name);
    text.push_str(inner);
    pair(text, 0, "ENDSEC");
}

/// Beginning of a named record of a table.
fn record(text: &mut String, kind: &str, handle: &str, table: u32, class: &str, name: &str) {
    pair(text, 0, kind);
    pair(text, 5, handle);
    pair(text, 330, format!("{table:X}"));
    pair(text, 100, "AcDbSymbolTableRecord");
    pair(text, 100, class);
    pair(text, 2, name);
    pair(text, 70, 0);
}

/// The dictionary of the drawing, with that of groups, which is empty.
fn objects() -> String {
    let mut text = String::new();
    for (at, owner) in [
        (handle::DICTIONARY, 0),
        (handle::GROUPS, handle::DICTIONARY),
    ] {
        pair(&mut text, 0, "DICTIONARY");
        pair(&mut text, 5, format!("{at:X}"));
        pair(&mut text, 330, format!("{owner:X}"));
        pair(&mut text, 100, "AcDbDictionary");
        pair(&mut text, 281, 1);
        if at == handle::DICTIONARY {
            pair(&mut text, 3, "ACAD_GROUP");
            pair(&mut text, 350, format!("{:X}", handle::GROUPS));
        }
    }
    text
}
