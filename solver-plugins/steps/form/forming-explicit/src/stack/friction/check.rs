//! Whether a law of friction is one.

use crate::error::{FormingError, Result};
use plyflow_mechanics::contact::LARGEST_COEFFICIENT;
use plyflow_model::friction::{AngleLaw, Coefficient, FrictionLaw, PowerLaw, PressureLaw};

/// Whether what a scene gives at a place is a coefficient or a law.
pub fn check(given: &Coefficient, place: &str) -> Result<()> {
    match given {
        Coefficient::Law(law) => check_law(law, place),
        Coefficient::Constant(n) => check_coefficient(n.0, place),
    }
}

fn check_coefficient(value: f64, place: &str) -> Result<()> {
    if (0.0..=LARGEST_COEFFICIENT).contains(&value) {
        return Ok(());
    }
    let expected = format!("a coefficient from 0 to {LARGEST_COEFFICIENT}");
    Err(FormingError::value(place, value.to_string(), expected))
}

/// Whether the first numbers of the rows grow, from at least 0.
fn check_rows(rows: &[f64], place: &str, what: &str) -> Result<()> {
    if rows.len() < 2 {
        return Err(FormingError::Scene(format!(
            "{place}: {} given; expected two or more rows with growing {what}",
            if rows.is_empty() { "no row" } else { "one row" }
        )));
    }
    match (1..rows.len()).find(|k| rows[*k] <= rows[k - 1]) {
        None if rows[0] >= 0.0 && rows[rows.len() - 1].is_finite() => Ok(()),
        None => Err(FormingError::Scene(format!(
            "{place}: expected {what} from 0, all of them finite"
        ))),
        Some(k) => Err(FormingError::Scene(format!(
            "{place}[{k}]: {} follows {}; expected growing {what}",
            rows[k],
            rows[k - 1]
        ))),
    }
}

/// Whether a law is one: coefficients from 0 to the largest, tables in order.
pub fn check_law(law: &FrictionLaw, place: &str) -> Result<()> {
    let mut largest = 0.0f64;
    match (&law.pressure, law.coefficient) {
        (Some(PressureLaw::Table(rows)), None) => {
            let pressures: Vec<f64> = rows.iter().map(|r| r.pressure.si()).collect();
            check_rows(
                &pressures,
                &format!("{place}.pressure.table"),
                "pressures (Pa)",
            )?;
            for (k, row) in rows.iter().enumerate() {
                let at = format!("{place}.pressure.table[{k}].coefficient");
                check_coefficient(row.coefficient.0, &at)?;
                largest = largest.max(row.coefficient.0);
            }
        }
        (Some(PressureLaw::Table(_)), Some(_)) => {
            return Err(FormingError::Scene(format!(
                "{place}.coefficient: given beside a table by pressure, which says it all; remove one of the two"
            )));
        }
        (_, None) => {
            return Err(FormingError::Scene(format!(
                "{place}.coefficient: not given; expected a number from 0 to 2"
            )));
        }
        (power, Some(c)) => {
            check_coefficient(c.0, &format!("{place}.coefficient"))?;
            largest = c.0;
            if let Some(PressureLaw::Power(p)) = power {
                check_power(p, &format!("{place}.pressure.power"))?;
            }
        }
    }
    match &law.angle {
        Some(angle) => check_angle(angle, largest, &format!("{place}.angle")),
        None => Ok(()),
    }
}

/// Whether a power of pressure is one.
fn check_power(law: &PowerLaw, place: &str) -> Result<()> {
    let (reference, exponent) = (law.reference.si(), law.exponent.0);
    let wrong = |what: &str, given: String, expected: &str| {
        Err(FormingError::value(
            format!("{place}.{what}"),
            given,
            expected,
        ))
    };
    if !(reference > 0.0 && reference.is_finite()) {
        return wrong(
            "reference",
            format!("{reference} Pa"),
            "a pressure above 0 Pa",
        );
    }
    if !(exponent > -1.0 && exponent <= 1.0) {
        let expected = "more than -1 (friction would fall as pressure grows) and at most 1";
        return wrong("exponent", exponent.to_string(), expected);
    }
    Ok(())
}

/// Whether factors by angle are such; `largest`: the largest coefficient that they multiply.
fn check_angle(law: &AngleLaw, largest: f64, place: &str) -> Result<()> {
    let angles: Vec<f64> = law.factors.iter().map(|r| r.angle.si()).collect();
    check_rows(&angles, &format!("{place}.factors"), "angles (rad)")?;
    if angles[angles.len() - 1] > std::f64::consts::FRAC_PI_2 + 1e-9 {
        return Err(FormingError::Scene(format!(
            "{place}.factors: expected angles from 0 to 90 deg: a fibre has no sense"
        )));
    }
    for (k, row) in law.factors.iter().enumerate() {
        let factor = row.factor.0;
        if !(factor >= 0.0 && factor * largest <= LARGEST_COEFFICIENT) {
            let at = format!("{place}.factors[{k}].factor");
            let expected = format!(
                "0 or more, and a coefficient of at most {LARGEST_COEFFICIENT} in all (here {})",
                factor * largest
            );
            return Err(FormingError::value(at, factor.to_string(), expected));
        }
    }
    if !(1..=2).contains(&law.family) {
        let (at, given) = (format!("{place}.family"), law.family.to_string());
        return Err(FormingError::value(at, given, "1 or 2"));
    }
    Ok(())
}
