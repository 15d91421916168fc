//! Files of outlines: DXF drawings, and tables of corners.

use crate::dxf::{Contours, Drawing, Fineness};
use crate::flaw::Flaw;
use crate::{corners, dxf, flaw};
use plyflow_model::units::{Dimension, si_text};

/// Whether a text is a drawing, and no table: its first line is a group code.
fn is_drawing(text: &str) -> bool {
    let first = text.lines().next().unwrap_or_default().trim();
    !first.is_empty() && first.bytes().all(|b| b.is_ascii_digit())
}

/// The text of a file of outlines ([`flaw::plain`]).
///
/// # Errors
/// A sentence on what it is instead of text.
pub fn text(bytes: &[u8]) -> Result<String, String> {
    for (begin, what) in [
        (&b"AutoCAD Binary DXF"[..], "a DXF drawing in binary form"),
        (b"AC10", "a DWG drawing"),
    ] {
        if bytes.starts_with(begin) {
            return Err(format!(
                "it is {what}; save it as DXF in text, R12 or later"
            ));
        }
    }
    flaw::plain(bytes)
}

/// Reads an outline with its holes. `text` is what [`text`] gives of the file. `layer`: of a drawing, where it has curves on several;
/// `unit`: one unit of the file (m), where the file does not say it.
///
/// # Errors
/// What is wrong with it, with the place of each.
pub fn read(
    text: &str,
    layer: Option<&str>,
    unit: Option<f64>,
    fine: Fineness,
) -> Result<Contours, Vec<Flaw>> {
    if is_drawing(text) {
        let read = || {
            let drawing = Drawing::read(text)?;
            let unit = drawing.unit_or(unit)?;
            drawing.contours(layer, unit, fine)
        };
        return read().map_err(|f| vec![f]);
    }
    if layer.is_some() {
        let flaw = Flaw::whole("it is a table of corners, which has no layers");
        return Err(vec![flaw.expected("a DXF drawing where a layer is named")]);
    }
    corners::read(text, symbol(unit).map_err(|f| vec![f])?)
}

/// The name of a unit (m) in which the numbers of a table are.
///
/// # Errors
/// When it has none.
pub fn symbol(unit: Option<f64>) -> Result<Option<&'static str>, Flaw> {
    let symbol = unit.map(|metres| match dxf::Unit::of(metres) {
        dxf::Unit::Symbol(symbol) => Ok(symbol),
        dxf::Unit::Metres(_) => {
            let problem = format!(
                "the places of a table cannot be in units of {}",
                si_text(metres, Dimension::Length)
            );
            let flaw = Flaw::whole(problem);
            Err(flaw
                .expected("a unit that has a name, such as `1 mm`, or units in the table's head"))
        }
    });
    symbol.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_as_what_it_is() {
        let fine = Fineness::default();
        let table = "x,y\n0,0\n1,0\n0,1\n";
        let found = read(table, None, Some(1e-3), fine).unwrap();
        assert_eq!(found.outline[1], [1e-3, 0.0]);
        assert!(
            read(table, Some("A"), None, fine).unwrap_err()[0]
                .problem
                .contains("no layers")
        );
        assert!(
            read(table, None, Some(0.017), fine).unwrap_err()[0]
                .problem
                .contains("0.017 m")
        );
        let drawing = "0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n70\n1\n10\n0\n20\n0\n10\n1\n20\n0\n10\n0\n20\n1\n0\nENDSEC\n";
        assert_eq!(read(drawing, None, Some(1e-3), fine).unwrap(), found);
        assert_eq!(found.centred().outline[0], [-5e-4, -5e-4]);
        for (bytes, says) in [
            (&b"AC1032\0\0"[..], "a DWG drawing"),
            (b"AutoCAD Binary DXF\r\n\x1a\0", "binary form"),
            (b"a\0b", "no text"),
        ] {
            assert!(text(bytes).unwrap_err().contains(says));
        }
    }

    #[test]
    fn a_unit_that_is_not_that_of_the_file_is_refused() {
        let dxf = |unit: &str| {
            let words = format!(
                "0 SECTION 2 HEADER 9 $INSUNITS 70 {unit} 0 ENDSEC 0 SECTION 2 ENTITIES 0 CIRCLE 8 P 10 0 20 0 40 1 0 ENDSEC 0 EOF"
            );
            words.replace(' ', "\n") + "\n"
        };
        let told = |text: &str, unit: Option<f64>| {
            let read = read(text, None, unit, Fineness::default());
            read.map(|c| c.outline[0][0])
                .map_err(|f| f[0].of("p", text))
        };
        let corners = "x [mm],y [mm]\n1000,0\n2000,0\n1000,1000\n";
        assert_eq!(told(corners, Some(1e-3)), Ok(1.0));
        assert_eq!(told(corners, None), Ok(1.0));
        let refused = told(corners, Some(0.0254)).unwrap_err();
        assert!(
            refused.starts_with("p:1:1: `x` has the unit `mm` here, and `unit` says in"),
            "{refused}"
        );
        // A drawing that says no unit, or the same.
        assert_eq!(told(&dxf("0"), Some(0.0254)).unwrap().abs(), 0.0254);
        assert_eq!(told(&dxf("1"), Some(0.0254)).unwrap().abs(), 0.0254);
        assert_eq!(told(&dxf("1"), None).unwrap().abs(), 0.0254);
        let refused = told(&dxf("1"), Some(1e-3)).unwrap_err();
        assert!(
            refused.contains("one unit of it is 1 in ($INSUNITS is 1), and `unit` that it is 1 mm"),
            "{refused}"
        );
    }
}
