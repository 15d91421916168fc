//! Friction as a table.

use crate::units::{number, quantity};
use maud::{Markup, html};
use plyflow_model::friction::{Coefficient, Friction, FrictionLaw, Place, PressureLaw};

pub(super) fn table(friction: &Friction) -> Markup {
    let classes = [
        ("tool on film", &friction.tool_diaphragm),
        ("tool on fabric", &friction.tool_fabric),
        ("fabric on film", &friction.fabric_diaphragm),
        ("fabric on fabric", &friction.fabric_fabric),
        ("film on film", &friction.diaphragm_diaphragm),
    ];
    let classes = classes
        .into_iter()
        .filter_map(|(name, c)| Some((name.to_owned(), told(c.as_ref()?))));
    let pairs = friction
        .pairs
        .iter()
        .map(|p| (p.names().join(" on "), law(&p.law())));
    html! {
        h4 { "Friction" }
        table { thead { tr { th { "surfaces" } th { "coefficient" } } }
            tbody { @for (name, text) in classes.chain(pairs) { tr { th { (name) } td { (text) } } } } }
    }
}

fn told(c: &Coefficient) -> String {
    match c {
        Coefficient::Constant(mu) => number(mu.0, 4),
        Coefficient::Law(l) => law(l),
    }
}

/// A law in words.
fn law(l: &FrictionLaw) -> String {
    let mut text = match (&l.pressure, l.coefficient) {
        (Some(PressureLaw::Power(p)), c) => format!(
            "{} (p / {})^{}",
            c.map_or_else(String::new, |c| number(c.0, 4)),
            quantity(p.reference.si(), "Pa", 4),
            number(p.exponent.0, 4)
        ),
        (Some(PressureLaw::Table(rows)), _) => {
            let row = |r: &plyflow_model::friction::PressureRow| {
                format!(
                    "{} at {}",
                    number(r.coefficient.0, 4),
                    quantity(r.pressure.si(), "Pa", 4)
                )
            };
            let rows: Vec<String> = rows.iter().map(row).collect();
            rows.join(", ")
        }
        (None, c) => c.map_or_else(|| "–".to_owned(), |c| number(c.0, 4)),
    };
    if let Some(angle) = &l.angle {
        let row = |r: &plyflow_model::friction::AngleRow| {
            format!(
                "{} at {}",
                number(r.factor.0, 4),
                quantity(r.angle.si(), "rad", 4)
            )
        };
        let rows: Vec<String> = angle.factors.iter().map(row).collect();
        let of = match angle.of {
            Some(Place::Lower) => " of the lower ply",
            Some(Place::Upper) => " of the upper ply",
            None => "",
        };
        text += &format!(
            "; by the angle to fibres {}{of}, times {}",
            angle.family,
            rows.join(", ")
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn laws_are_told_in_words_with_the_units_of_the_trade() {
        let of = |v| told(&serde_json::from_value(v).unwrap());
        assert_eq!(of(json!(0.51)), "0.51");
        let power = json!({"coefficient": 0.3, "pressure": {"power": {"reference": "10 kPa", "exponent": -0.2}}});
        assert_eq!(of(power), "0.3 (p / 10 kPa)^-0.2");
        let by_angle = json!({"pressure": {"table": [{"pressure": "0 Pa", "coefficient": 0.2}, {"pressure": "1 bar", "coefficient": 0.4}]},
            "angle": {"of": "upper", "family": 2, "factors": [{"angle": "0 deg", "factor": 1}, {"angle": "90 deg", "factor": 1.5}]}});
        assert_eq!(
            of(by_angle),
            "0.2 at 0 kPa, 0.4 at 100 kPa; by the angle to fibres 2 of the upper ply, times 1 at 0 deg, 1.5 at 90 deg"
        );
    }
}
