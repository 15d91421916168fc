//! The table of a ply whose fibres are steered.

use super::{Filler, entry_mut, list, moved, text};
use crate::yaml::{Entry, Kind, Node};
use plyflow_files::drawn;
use plyflow_files::flaw::Flaw;
use plyflow_files::open::MOST_WRITTEN;
use plyflow_files::steered::{self, Row};
use plyflow_model::steering::SteeringTable;
use plyflow_model::units::Length;

impl Filler<'_> {
    /// Puts points in the place of the table that the fibres of a sheet follow.
    pub(super) fn steering_of(&mut self, sheet: &mut Node) {
        let Some(entry) = entry_mut(sheet, "fibre_1") else {
            return;
        };
        let Some(node) = entry.value.get("table") else {
            return;
        };
        let Ok(table) = serde_json::from_value::<SteeringTable>(node.to_json()) else {
            // The schema check has spoken.
            self.sound = false;
            return;
        };
        let file = node.get("file").map_or(&node.span, |f| &f.span).clone();
        let unit = match drawn::symbol(table.unit.map(Length::si)) {
            Ok(unit) => unit,
            Err(flaw) => {
                let span = node.get("unit").map_or(&node.span, |u| &u.span).clone();
                return self.tell(&Flaw { span, ..flaw }, 0);
            }
        };
        let Some((read, base)) = self.text(&table.file, &file, MOST_WRITTEN) else {
            return;
        };
        match steered::read(&read, unit) {
            Ok(rows) => {
                let points = rows.iter().map(|row| point(row, base)).collect();
                entry.value.kind = Kind::Map(vec![Entry {
                    key: "points".into(),
                    key_span: file.clone(),
                    value: list(points, &file),
                }]);
            }
            Err(flaws) => {
                for flaw in flaws {
                    self.of_drawing(flaw, &table.file, &file, base);
                }
            }
        }
    }
}

/// A row as a point of the scene.
fn point(row: &Row, base: usize) -> Node {
    let [x, y] = &row.place;
    let entries = [("x", x), ("y", y), ("angle", &row.angle)];
    let entry = |(key, amount): (&str, &plyflow_files::table::Amount)| {
        let span = moved(&amount.span, base);
        Entry {
            key: key.into(),
            key_span: span.clone(),
            value: text(amount.text.clone(), &span),
        }
    };
    Node {
        kind: Kind::Map(entries.into_iter().map(entry).collect()),
        span: moved(&row.span, base),
    }
}
