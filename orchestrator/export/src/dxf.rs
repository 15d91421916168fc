//! Drawings (DXF of AutoCAD 2000): the flat plies with their fibre lines, and where both lie on the formed part.
//!
//! Written here: the crate `dxf` puts the time of day and random numbers into a file, and brings a decoder of pictures along.
//! A reader asks for tables, two blocks and a dictionary even where nothing is in them; handles are hexadecimal numbers that are used once.

use crate::File;
use crate::boundary::loops;
use crate::error::ExportError;
use crate::net::fibres;
use crate::part::{Body, Part, Ply};
use crate::request::{LengthUnit, Request};
use crate::vec3::Vec3;
use std::fmt::Write as _;

/// Writes both drawings.
pub fn write(
    part: &Part,
    request: &Request,
    files: &mut Vec<File>,
    told: &mut Vec<String>,
) -> Result<(), ExportError> {
    let mut flat = Drawing::new(request.unit, &part.origin);
    let mut draped = Drawing::new(request.unit, &part.origin);
    for body in &part.bodies {
        let ply = body.ply.as_ref().expect("plies alone are drawn");
        body.tell_missing(told);
        let (name, colour) = (&body.name, (ply.number % 6 + 1) as u8);
        let boundary = loops(body.usable().into_iter().map(|c| body.corners(c)));
        let pattern = pattern(body, ply, part.scale);
        let edge = flat.layer(name, colour);
        for line in &pattern {
            flat.closed_plane(edge, line);
        }
        let reached = flat.layer(&format!("{name}-draped"), colour);
        let edge = draped.layer(name, colour);
        for line in boundary {
            let at = |points: &[Vec3]| -> Vec<Vec3> {
                line.iter().map(|i| points[*i as usize]).collect()
            };
            flat.closed_plane(reached, &at(&body.flat));
            draped.line(edge, &at(&body.points), true);
        }
        // Said with the fields already where they are not known.
        let Some(directions) = ply.sheet.fibres() else {
            continue;
        };
        for (family, angle) in directions.into_iter().enumerate() {
            let layer = format!("{name}-fibres_{}", family + 1);
            let (on_flat, on_draped) = (flat.layer(&layer, 8), draped.layer(&layer, 8));
            for fibre in fibres(body, angle, part.scale * request.net, part.scale)? {
                flat.open_plane(on_flat, &fibre.flat);
                draped.line(on_draped, &fibre.formed, false);
            }
        }
    }
    for (what, drawing) in [("flat", flat), ("draped", draped)] {
        files.push(File {
            name: format!("{}-{what}.dxf", request.stem),
            content: drawing.finish().into_bytes(),
        });
    }
    Ok(())
}

/// Edge and holes of the whole flat ply: as the scene has them where the artifact tells, else the boundary of the mesh.
fn pattern(body: &Body, ply: &Ply, scale: f64) -> Vec<Vec<Vec3>> {
    let placed = |line: &Vec<[f64; 2]>| {
        line.iter()
            .map(|p| [scale * p[0], scale * p[1], 0.0])
            .collect()
    };
    match &ply.sheet.outline {
        Some(outline) => std::iter::once(outline)
            .chain(&ply.sheet.holes)
            .map(placed)
            .collect(),
        None => {
            let of = |line: Vec<u32>| line.iter().map(|i| body.flat[*i as usize]).collect();
            loops((0..body.count()).map(|c| body.corners(c)))
                .into_iter()
                .map(of)
                .collect()
        }
    }
}

/// A drawing on the way.
struct Drawing {
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
    fn new(unit: LengthUnit, about: &[String]) -> Self {
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

    fn layer(&mut self, name: &str, colour: u8) -> usize {
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

    fn closed_plane(&mut self, layer: usize, points: &[Vec3]) {
        self.plane(layer, points, true);
    }

    fn open_plane(&mut self, layer: usize, points: &[Vec3]) {
        // A fibre of the flat ply is straight: its ends are enough.
        if let [first, .., last] = points {
            self.plane(layer, &[*first, *last], false);
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
    fn line(&mut self, layer: usize, points: &[Vec3], closed: bool) {
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

    fn finish(mut self) -> String {
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

    /// The nine tables, most of them with what every drawing has to have.
    fn tables(&mut self, layers: &str) -> String {
        let [
            viewports,
            types,
            _,
            styles,
            views,
            systems,
            programs,
            dimensions,
            blocks,
        ] = handle::TABLES;
        let mut kinds = String::new();
        for name in ["ByBlock", "ByLayer", "Continuous"] {
            let handle = self.handle();
            record(
                &mut kinds,
                "LTYPE",
                &handle,
                types,
                "AcDbLinetypeTableRecord",
                name,
            );
            pair(&mut kinds, 3, "");
            pair(&mut kinds, 72, 65);
            pair(&mut kinds, 73, 0);
            pair(&mut kinds, 40, 0);
        }
        let mut style = String::new();
        let handle = self.handle();
        record(
            &mut style,
            "STYLE",
            &handle,
            styles,
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
            pair(&mut style, code, value);
        }
        let mut program = String::new();
        let handle = self.handle();
        record(
            &mut program,
            "APPID",
            &handle,
            programs,
            "AcDbRegAppTableRecord",
            "ACAD",
        );
        let mut block = String::new();
        for (at, name) in [
            (handle::MODEL, "*Model_Space"),
            (handle::PAPER, "*Paper_Space"),
        ] {
            pair(&mut block, 0, "BLOCK_RECORD");
            pair(&mut block, 5, format!("{at:X}"));
            pair(&mut block, 330, format!("{blocks:X}"));
            pair(&mut block, 100, "AcDbSymbolTableRecord");
            pair(&mut block, 100, "AcDbBlockTableRecord");
            pair(&mut block, 2, name);
        }
        let mut text = String::new();
        for (name, at, count, records) in [
            ("VPORT", viewports, 0, ""),
            ("LTYPE", types, 3, kinds.as_str()),
            ("LAYER", handle::TABLES[2], self.layers.len(), layers),
            ("STYLE", styles, 1, style.as_str()),
            ("VIEW", views, 0, ""),
            ("UCS", systems, 0, ""),
            ("APPID", programs, 1, program.as_str()),
            ("DIMSTYLE", dimensions, 0, ""),
            ("BLOCK_RECORD", blocks, 2, block.as_str()),
        ] {
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
