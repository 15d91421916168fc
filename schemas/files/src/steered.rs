//! Tables of fibre directions: places of a flat ply, each with the direction of its fibres.

use crate::flaw::Flaw;
use crate::table::{Amount, Known, Table};
use plyflow_model::steering::MOST_POINTS;
use plyflow_model::units::Dimension;
use std::ops::Range;

const fn column(names: &'static [&'static str], of: Dimension) -> Known {
    Known {
        names,
        of: Some(of),
        needed: true,
    }
}

const COLUMNS: [Known; 3] = [
    column(&["x"], Dimension::Length),
    column(&["y"], Dimension::Length),
    column(&["angle", "direction", "orientation"], Dimension::Angle),
];

/// A place with the direction of the fibres there.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Its coordinates.
    pub place: [Amount; 2],
    /// The direction, from x.
    pub angle: Amount,
    /// All of the row.
    pub span: Range<usize>,
}

/// Reads a table of directions; `text` is what [`crate::flaw::plain`] gives of its file, `unit` the unit of places without one (as a scene writes it).
/// Angles without a unit are in degrees.
///
/// # Errors
/// What is wrong with its form, each with its place.
pub fn read(text: &str, unit: Option<&str>) -> Result<Vec<Row>, Vec<Flaw>> {
    let table = Table::read(text, &COLUMNS, MOST_POINTS)?;
    let other_unit = |k: usize| table.other_unit(k, unit);
    let mut flaws: Vec<Flaw> = (0..2).filter_map(other_unit).collect();
    let mut rows = Vec::new();
    for row in &table.rows {
        let amount = |k: usize, unit: Option<&str>| match &row.cells[k] {
            Some(cell) => table.amount(k, cell, unit),
            None => {
                let problem = format!("the point has no `{}`", COLUMNS[k].names[0]);
                Err(Flaw::at(row.span.clone(), problem)
                    .expected("`x`, `y` and `angle` in every row"))
            }
        };
        let span = row.span.clone();
        match (amount(0, unit), amount(1, unit), amount(2, Some("deg"))) {
            (Ok(x), Ok(y), Ok(angle)) => rows.push(Row {
                place: [x, y],
                angle,
                span,
            }),
            (x, y, angle) => {
                flaws.extend([x, y, angle].into_iter().filter_map(Result::err));
            }
        }
        // Far from the first: each would say the same.
        if flaws.len() >= 10 {
            break;
        }
    }
    if table.rows.is_empty() {
        let flaw = Flaw::at(table.head.clone(), "the table has no point");
        flaws.push(flaw.expected("a row for each point below the head"));
    }
    match flaws.is_empty() {
        true => Ok(rows),
        false => Err(flaws),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_read_with_units_as_people_write_them() {
        let text =
            "# placed on machine 2\nx [mm];y [mm];angle;note\n0;0;0;start\n12,5;-3 cm;0,5 rad;\n";
        let rows = read(text, None).unwrap_or_else(|e| panic!("{e:?}"));
        let all: Vec<[f64; 3]> = rows
            .iter()
            .map(|r| [r.place[0].si, r.place[1].si, r.angle.si])
            .collect();
        assert_eq!(all, [[0.0; 3], [0.0125, -0.03, 0.5]]);
        assert_eq!(rows[0].angle.text, "0 deg");
        assert!(text[rows[1].span.clone()].starts_with("12,5"));
        let both = read("x [mm],y [mm],direction\n1,2,180\n", Some("cm")).unwrap_err();
        assert!(
            both[0]
                .problem
                .contains("`x` has the unit `mm` here, and `unit` says cm")
        );
        assert_eq!(both.len(), 2, "of `y` as well");
        let bare = read("x,y,direction\n1,2,180\n", Some("cm")).unwrap();
        assert_eq!(bare[0].place[1].text, "2 cm");
        assert_eq!(bare[0].angle.si, std::f64::consts::PI);
    }

    #[test]
    fn what_is_no_table_of_directions_is_told_where_it_stands() {
        for (text, says) in [
            (
                "x,y,angle\n1,2,3\n",
                "t.csv:2:1: `x` is `1`, without a unit",
            ),
            (
                "x [mm],y [mm]\n1,2\n",
                "t.csv:1:1: the head has no column angle",
            ),
            (
                "x [mm],y [mm],angle\n1,,3\n",
                "t.csv:2:1: the point has no `y`",
            ),
            (
                "x [mm],y [mm],angle\n1,2,steep\n",
                "t.csv:2:5: `angle` is `steep`, which is no angle",
            ),
            (
                "x [mm],y [mm],angle [mm]\n1,2,3\n",
                "t.csv:1:15: the unit of `angle`",
            ),
            ("x [mm],y [mm],angle\n", "t.csv:1:1: the table has no point"),
            (
                "x [mm],y [mm],angel\n1,2,3\n",
                "t.csv:1:15: there is no column `angel`",
            ),
        ] {
            let flaws = read(text, None).unwrap_err();
            let told = flaws[0].of("t.csv", text);
            assert!(told.starts_with(says), "{text:?}: {told}");
        }
    }
}
