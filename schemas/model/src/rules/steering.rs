//! Rules of steered fibres: their points tell a direction at each place of the ply.

use crate::fault::{Fault, Path, Phrase, Rule, Shown, degrees};
use crate::outline::Millimetres;
use crate::scene::Sheet;
use crate::steering::{MOST_TURN, SharpTurn, SteeredField, Steering, SteeringError};

/// All that is wrong with the steering of a ply.
pub fn check(sheet: &Sheet, steering: &Steering, at: &Path) -> Vec<Fault> {
    let mut found = Vec::new();
    if sheet.fibre_2.is_some() {
        let text = "`fibre_2` stands beside steered fibres";
        let fault = Fault::text(Rule::Fibres, at.key("fibre_2"), text).shown(Shown::Key);
        found.push(
            fault
                .expected("no `fibre_2`: family 2 lies 90 deg counter-clockwise of family 1 at each place")
                .help("leave it out"),
        );
    }
    let at = at.key("fibre_1");
    let points = steering.points(sheet.centre.map(|c| c.si()));
    match points.and_then(SteeredField::new) {
        Ok(field) => {
            // A ply without a shape is told by itself.
            let ply = sheet.footprint().ok().flatten();
            let sharp = field.sharp_turn(ply.as_ref());
            found.extend(sharp.map(|turn| too_sharp(&field, turn, &at)));
        }
        Err(error) => found.push(no_field(error, &at)),
    }
    found
}

fn too_sharp(field: &SteeredField, turn: SharpTurn, at: &Path) -> Fault {
    let place = |k: usize| {
        let [x, y, _] = field.points()[k];
        Millimetres([x, y])
    };
    let at = |k: usize| at.key("points").item(k).key("angle");
    let text = format!(
        "fibres turn by {} between neighbouring points, from the one at {} to the one at {}",
        degrees(turn.apart),
        place(turn.first),
        place(turn.second)
    );
    let other = (at(turn.first), degrees(field.points()[turn.first][2]));
    Fault::text(Rule::Fibres, at(turn.second), text)
        .expected(Phrase::with_value(
            &format!(
                "less than {} between this direction and the ",
                degrees(MOST_TURN)
            ),
            other,
            " of the other point: else it is open which way they turn",
        ))
        .help("give points between the two (places of points count over the tool, with the ply's `centre`)")
}

fn no_field(error: SteeringError, at: &Path) -> Fault {
    let points = at.key("points");
    match error {
        SteeringError::Same { first, second, at } => {
            let text = format!("there are two points at {at}");
            Fault::text(Rule::Fibres, points.item(second), text).expected(Phrase::with_place(
                "every place once (it stands ",
                points.item(first).key("x"),
                " already)",
            ))
        }
        SteeringError::NoNumber(k) => Fault::text(Rule::Fibres, points.item(k), error.to_string()),
        SteeringError::Count(_) => Fault::text(Rule::Fibres, points, error.to_string()),
        SteeringError::NotRead(_) => {
            Fault::text(Rule::Fibres, at.key("table").key("file"), error.to_string())
        }
    }
}
