//! Tables of corners: an outline, with its holes, in columns `x` and `y`.

use crate::dxf::{Closed, Contours, nested};
use crate::flaw::Flaw;
use crate::table::{Known, Table};
use plyflow_model::outline::MOST_CORNERS;
use plyflow_model::units::Dimension;

const COLUMNS: [Known; 3] = [
    Known {
        names: &["x"],
        of: Some(Dimension::Length),
        needed: true,
    },
    Known {
        names: &["y"],
        of: Some(Dimension::Length),
        needed: true,
    },
    Known {
        names: &["contour"],
        of: None,
        needed: false,
    },
];

/// Reads the corners of a table; `text` is what [`crate::flaw::plain`] gives of its file, `unit` the unit of numbers without one (as a scene writes
/// it). Rows with the same word in the column `contour` are one contour; the largest is the outline, and the others are its holes.
///
/// # Errors
/// All that is wrong with its form, or the first thing that is wrong with its contours.
pub fn read(text: &str, unit: Option<&str>) -> Result<Contours, Vec<Flaw>> {
    let table = Table::read(text, &COLUMNS, 4 * MOST_CORNERS)?;
    let mut contours: Vec<(Option<String>, Closed)> = Vec::new();
    let other_unit = |k: usize| table.other_unit(k, unit);
    let mut flaws: Vec<Flaw> = (0..2).filter_map(other_unit).collect();
    for row in &table.rows {
        let mut point = [0.0; 2];
        for (k, into) in point.iter_mut().enumerate() {
            let name = COLUMNS[k].names[0];
            let amount = match &row.cells[k] {
                Some(cell) => table.amount(k, cell, unit),
                None => Err(
                    Flaw::at(row.span.clone(), format!("the corner has no `{name}`"))
                        .expected("`x` and `y` in every row"),
                ),
            };
            match amount {
                Ok(amount) => *into = amount.si,
                Err(flaw) => flaws.push(flaw),
            }
        }
        let name = row.cells[2].as_ref().map(|c| c.text.clone());
        match contours.iter_mut().find(|c| c.0 == name) {
            Some((_, contour)) => contour.points.push(point),
            None => {
                let (points, span) = (vec![point], row.span.clone());
                contours.push((name, Closed { points, span }));
            }
        }
        // Far from the first: each would say the same.
        if flaws.len() >= 10 {
            break;
        }
    }
    if !flaws.is_empty() {
        return Err(flaws);
    }
    nested(contours.into_iter().map(|c| c.1).collect()).map_err(|f| vec![f])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_those_that_a_scene_would_list_and_rows_of_another_contour_are_holes() {
        let text = "x [mm],y [mm],contour\n0,0,edge\n200,0,edge\n200,100,edge\n0,100,edge\n50,50,a\n60,50,a\n60,60,a\n";
        let found = read(text, None).unwrap();
        assert_eq!(
            found.outline,
            [[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.0, 0.1]]
        );
        assert_eq!(
            found.holes,
            [vec![[0.05, 0.05], [0.06, 0.05], [0.06, 0.06]]]
        );
        let bare = read("x;y\n0;0\n2,5;0\n0;1\n", Some("cm")).unwrap();
        assert_eq!(bare.outline[1], [0.025, 0.0]);
    }

    #[test]
    fn what_is_no_outline_is_told_where_it_stands() {
        for (text, says) in [
            ("x,y\n0,0\n", "t.csv:2:1: `x` is `0`, without a unit"),
            ("x [mm],y [mm]\n0,\n", "t.csv:2:1: the corner has no `y`"),
            (
                "x [mm],y [mm]\n0,0\n1,0\n",
                "has 2 corners; expected 3 to 5000",
            ),
            (
                "x [mm],y [mm]\n0,0\n10,10\n10,0\n0,10\n",
                "crosses or touches itself at (5, 5) mm",
            ),
            (
                "x [mm],y [mm]\n0,0\n10,0\n10,0\n0,10\n",
                "points 1 and 2 of outline are the same",
            ),
            (
                "x [mm],y [mm],contour\n0,0,a\n10,0,a\n0,10,a\n20,0,b\n21,0,b\n20,1,b\n",
                "t.csv:5:1: the contour that begins here crosses or touches the largest one, or lies outside of it",
            ),
        ] {
            let flaws = read(text, None).unwrap_err();
            let told = flaws[0].of("t.csv", text);
            assert!(told.contains(says), "{text:?}: {told}");
        }
    }
}
