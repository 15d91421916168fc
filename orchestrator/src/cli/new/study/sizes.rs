//! The sizes and durations of a new study, with the reason for each.

use super::part::Part;
use super::words::mm;

/// A value with why it was taken, for a comment.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// As YAML has it.
    pub value: String,
    /// A sentence without its full stop.
    pub why: String,
}

fn chosen(value: String, why: impl Into<String>) -> Chosen {
    let why = why.into();
    Chosen { value, why }
}

/// Sizes of elements (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elements {
    /// Of the membranes of the whole.
    pub whole: f64,
    /// Of the shells of the zones.
    pub zone: f64,
}

/// Elements of a bag: what the whole is formed with, and its zones. `least`: the least length or width of a ply (m).
pub fn elements(part: &Part, least: f64) -> (Elements, [Chosen; 2]) {
    // A joggle spar of 200 mm with plies of 300 mm is formed well enough by membranes of 8 to 16 mm for a first look.
    let across = part.size[0].min(part.size[1]).min(least);
    let whole = (1e3 * across / 12.0).round().clamp(4.0, 16.0) * 1e-3;
    let half = 0.5 * whole;
    let wanted = part.radius.map_or(half, |r| (0.4 * r).min(half));
    let zone = (2e3 * wanted.max(0.25 * whole)).round().max(2.0) * 0.5e-3;
    let whole_why = format!(
        "a twelfth of the narrower of tool and ply ({}), between 4 and 16 mm: enough to see where it shears and stands off the tool. Half of it shows what changes",
        mm((1e4 * across).round() * 1e-4)
    );
    let zone_why = match part.radius {
        Some(r) if zone <= 0.4 * r * 1.02 => format!(
            "no more than 0.4 of the smallest radius of the tool, about {}, and than half of the membranes",
            mm((1e4 * r).round() * 1e-4)
        ),
        Some(r) => format!(
            "half of the membranes or less. The smallest radius of the tool, about {}, would need {}: take it where wrinkles lie on it",
            mm((1e4 * r).round() * 1e-4),
            mm((4e3 * r).round() * 1e-4)
        ),
        None => "half of the membranes: the tool has no roundings".to_owned(),
    };
    (
        Elements { whole, zone },
        [chosen(mm(whole), whole_why), chosen(mm(zone), zone_why)],
    )
}

/// Length and width of the frame (m), rounded up to 10 mm.
pub fn frame(part: &Part, ply: [f64; 2]) -> ([f64; 2], Chosen) {
    let margin = (3.0 * part.size[2]).max(0.12);
    let frame: [f64; 2] = std::array::from_fn(|k| {
        let inner = part.size[k].max(ply[k]);
        ((inner + 2.0 * margin) * 100.0 - 1e-6).ceil() / 100.0
    });
    let why = format!(
        "{} around tool and plies: three times the tool's height, at least 120 mm. Give that of the machine",
        mm(margin)
    );
    (frame, chosen(String::new(), why))
}

/// Durations of lowering and of drawing a bag.
pub fn durations(part: &Part) -> [Chosen; 2] {
    // Between those of a flat block of 20 mm and of a spar of 110 mm, which are known to be slow enough.
    let share = ((part.size[2] - 0.02) / 0.09).clamp(0.0, 1.5);
    let between = |low: f64, high: f64| {
        let ms = ((low + share * (high - low)) / 10.0).round() * 10.0;
        format!("{ms} ms")
    };
    let why = "between those of a flat block and of a spar of 110 mm, by the tool's height";
    [
        chosen(between(150.0, 300.0), why),
        chosen(between(200.0, 400.0), "likewise"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(size: [f64; 3], radius: Option<f64>) -> Part {
        Part {
            words: Vec::new(),
            size,
            reach: 0.5 * size[0].hypot(size[1]),
            undercut: 0.0,
            radius,
            sharp: radius.is_none(),
        }
    }

    #[test]
    fn elements_follow_the_part_and_its_roundings_and_stay_within_bounds() {
        let of = |size, radius, least| elements(&part(size, radius), least).0;
        let hat = of([0.3, 0.12, 0.04], Some(0.008), 0.2);
        assert_eq!(
            [hat.whole, hat.zone].map(|s| (1e4 * s).round()),
            [100.0, 30.0]
        );
        let large = of([2.0, 1.0, 0.1], Some(0.1), 1.4);
        assert_eq!(
            [large.whole, large.zone].map(|s| (1e4 * s).round()),
            [160.0, 80.0]
        );
        let sharp = elements(&part([0.3, 0.12, 0.04], None), 0.2);
        assert!(sharp.1[1].why.contains("no roundings"), "{:?}", sharp.1);
        let fine = elements(&part([0.3, 0.12, 0.04], Some(0.001)), 0.2);
        assert_eq!(
            (1e4 * fine.0.zone).round(),
            25.0,
            "a quarter of the membranes at least"
        );
        assert!(fine.1[1].why.contains("would need 0.4 mm"), "{:?}", fine.1);
    }

    #[test]
    fn the_frame_holds_tool_and_plies_and_durations_grow_with_height() {
        let (frame, _) = frame(&part([0.3, 0.12, 0.04], None), [0.4, 0.1]);
        assert_eq!(frame.map(|f| (1e3 * f).round()), [640.0, 360.0]);
        let of = |h: f64| durations(&part([0.3, 0.12, h], None)).map(|c| c.value);
        assert_eq!(of(0.01), ["150 ms", "200 ms"]);
        assert_eq!(of(0.11), ["300 ms", "400 ms"]);
    }
}
