//! How large a DXF drawing is, for the frame and the elements of a study that is begun with it. Its outlines are read by the step `dxf_outline.py`.

/// Lengths of a unit (m) by `$INSUNITS`: those that drawings of plies have.
const UNITS: [(i64, f64); 5] = [(1, 0.0254), (2, 0.3048), (4, 1e-3), (5, 1e-2), (6, 1.0)];

/// Curves, whose points count.
const CURVES: [&str; 7] = [
    "LINE",
    "ARC",
    "CIRCLE",
    "ELLIPSE",
    "SPLINE",
    "LWPOLYLINE",
    "VERTEX",
];

/// A drawing that is text: pairs of lines, a code and a value.
fn pairs(text: &str) -> impl Iterator<Item = (i64, &str)> {
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let pairs = lines.chunks_exact(2).map(|p| (p[0].parse(), p[1]));
    let pairs: Vec<(i64, &str)> = pairs.map_while(|(c, v)| Some((c.ok()?, v))).collect();
    pairs.into_iter()
}

/// Length and width (m) of the box around the curves of a drawing, of those on `layer` alone if it is given; `None` where it does not say its
/// unit, has no curve outside of blocks, or is no text.
pub fn size(text: &str, layer: Option<&str>) -> Option<[f64; 2]> {
    let mut unit = None;
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    let (mut variable, mut section, mut named) = ("", "", false);
    let mut entity = Entity::default();
    for (code, value) in pairs(text).chain([(0, "EOF")]) {
        match code {
            0 => {
                if section == "ENTITIES" {
                    entity.count(layer, &mut low, &mut high);
                }
                named = value == "SECTION";
                entity = Entity::of(value);
            }
            2 if named => (section, named) = (value, false),
            9 => variable = value,
            70 if section == "HEADER" && variable == "$INSUNITS" => {
                let word = value.parse::<i64>().ok();
                unit = UNITS.iter().find(|u| Some(u.0) == word).map(|u| u.1);
            }
            8 => entity.layer = value.to_owned(),
            10 | 11 | 20 | 21 | 40 => entity.take(code, value.parse().ok()?),
            _ => {}
        }
    }
    let unit = unit?;
    let size = [0, 1].map(|k| unit * (high[k] - low[k]));
    size.iter()
        .all(|s| s.is_finite() && *s > 0.0)
        .then_some(size)
}

/// What counts of an entity.
#[derive(Default)]
struct Entity {
    is_curve: bool,
    is_round: bool,
    layer: String,
    x: Vec<f64>,
    y: Vec<f64>,
    radius: f64,
}

impl Entity {
    fn of(kind: &str) -> Self {
        Self {
            is_curve: CURVES.contains(&kind),
            is_round: kind == "ARC" || kind == "CIRCLE",
            ..Self::default()
        }
    }

    fn take(&mut self, code: i64, value: f64) {
        match code {
            10 | 11 => self.x.push(value),
            20 | 21 => self.y.push(value),
            _ => self.radius = value,
        }
    }

    fn count(&self, layer: Option<&str>, low: &mut [f64; 2], high: &mut [f64; 2]) {
        if !self.is_curve || layer.is_some_and(|l| !l.eq_ignore_ascii_case(&self.layer)) {
            return;
        }
        let radius = if self.is_round { self.radius } else { 0.0 };
        for (k, all) in [&self.x, &self.y].into_iter().enumerate() {
            for v in all {
                low[k] = low[k].min(v - radius);
                high[k] = high[k].max(v + radius);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_of_a_drawing_is_that_of_its_curves_in_its_unit() {
        let drawing = |unit: &str| {
            format!(
                "  0\nSECTION\n  2\nHEADER\n  9\n$EXTMIN\n 10\n1e20\n  9\n$INSUNITS\n 70\n{unit}\n  0\nENDSEC\n  0\nSECTION\n  2\nENTITIES\n\
                 0\nLWPOLYLINE\n8\nPLY\n10\n0\n20\n0\n10\n16\n20\n0\n10\n16\n20\n8\n10\n0\n20\n8\n\
                 0\nCIRCLE\n8\nHOLES\n10\n16\n20\n4\n40\n2\n0\nTEXT\n8\nPLY\n10\n900\n20\n900\n40\n5\n0\nENDSEC\n0\nEOF\n"
            )
        };
        let inches = size(&drawing("1"), Some("ply")).unwrap();
        assert_eq!(inches.map(|s| (1e6 * s).round()), [406_400.0, 203_200.0]);
        let all = size(&drawing("5"), None).unwrap();
        assert_eq!(all.map(|s| (1e6 * s).round()), [180_000.0, 80_000.0]);
        assert_eq!(size(&drawing("0"), None), None, "it does not say its unit");
        assert_eq!(size(&drawing("4"), Some("GONE")), None);
        assert_eq!(size("no drawing", None), None);
    }

    #[test]
    fn the_shipped_drawing_has_a_size() {
        let text = include_str!("../../../../../workflows/files-of-others/blank.dxf");
        let [length, width] = size(text, Some("PLY")).unwrap();
        assert!(
            length > 0.05 && length < 0.5 && width > 0.05 && width < 0.5,
            "{length} {width}"
        );
    }

    #[test]
    fn a_drawing_that_is_damaged_has_a_finite_size_or_none() {
        let text = include_str!("../../../../../workflows/files-of-others/blank.dxf");
        // A generator of our own, so that a failure comes again.
        let mut state = 1_u64;
        let mut next = |below: usize| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as usize % below
        };
        let mut sizes = 0;
        for _ in 0..300 {
            let mut lines: Vec<&str> = text.lines().collect();
            for _ in 0..=next(4) {
                let at = next(lines.len());
                match next(4) {
                    0 => drop(lines.remove(at)),
                    1 => lines.insert(at, ["0", "-1", "NaN", "1e999", "SECTION"][next(5)]),
                    2 => lines.truncate(at.max(1)),
                    _ => lines[at] = ["0", "10", "inf", "9223372036854775808", ""][next(5)],
                }
            }
            if let Some(size) = size(&lines.join("\n"), None) {
                assert!(size.iter().all(|s| s.is_finite() && *s > 0.0), "{size:?}");
                sizes += 1;
            }
        }
        assert!(sizes > 0, "all were refused: nothing was tried");
    }
}
