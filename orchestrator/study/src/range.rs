//! Ranges: values from one end to the other, both included.

use crate::number::{Exact, Quantity, double, of_double, power_of_ten, rounded};
use crate::problem::Problem;
use crate::value::Value;
use num_traits::{CheckedAdd, CheckedDiv, CheckedMul, CheckedSub, Signed, Zero};
use plyflow_fixed::FixedBits;

/// Most values of one range.
const MOST: u32 = 100_000;

/// From one end to the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Range {
    /// First value.
    pub from: Quantity,
    /// Last value, of the same dimension.
    pub to: Quantity,
    /// Whether equal steps are equal ratios.
    pub log: bool,
}

/// How a range is parted.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// By this much.
    By(Quantity),
    /// Into so many values.
    Count(u32),
}

impl Range {
    /// A range whose ends fit.
    ///
    /// # Errors
    /// When the ends have different dimensions, or a logarithmic one reaches zero.
    pub fn new(from: Quantity, to: &Quantity, log: bool) -> Result<Self, Problem> {
        let to = to
            .in_unit_of(&from)
            .map_err(|p| Problem::new(format!("`from` and `to` do not fit: {}", p.message)))?;
        if log && from.si.has_offset() {
            let message = format!("a logarithmic range in {}", from.unit);
            return Err(Problem::new(message).expected("a unit whose scale begins at zero"));
        }
        if log && !(from.number.is_positive() && to.number.is_positive()) {
            return Err(Problem::new("a logarithmic range reaches zero or below")
                .expected("`from` and `to` above zero"));
        }
        Ok(Self { from, to, log })
    }

    /// The value at a fraction of the way, 0 to 1, with as many digits as tell it apart: a millionth of the range, or of itself.
    ///
    /// # Errors
    /// When it has too many digits.
    pub fn at(&self, fraction: f64) -> Result<Value, Problem> {
        let (a, b) = (double(&self.from.number), double(&self.to.number));
        let value = match self.log {
            false => a + fraction * (b - a),
            true => (a.fixed_ln() + fraction * (b.fixed_ln() - a.fixed_ln())).fixed_exp(),
        };
        let exact = of_double(value).ok_or_else(too_fine)?;
        Ok(self.value(self.short(&exact).ok_or_else(too_fine)?))
    }

    /// The fraction of the way at which a value lies; `None` outside of the ends, or for another dimension.
    #[must_use]
    pub fn fraction(&self, value: &Value) -> Option<f64> {
        let Value::Quantity(q) = value else {
            return None;
        };
        let number = q.in_unit_of(&self.from).ok()?.number;
        let (from, to) = (self.from.number, self.to.number);
        if number < from.min(to) || number > from.max(to) {
            return None;
        }
        if from == to {
            return Some(0.5);
        }
        let (a, b, x) = (double(&from), double(&to), double(&number));
        Some(match self.log {
            false => (x - a) / (b - a),
            true => (x.fixed_ln() - a.fixed_ln()) / (b.fixed_ln() - a.fixed_ln()),
        })
    }

    fn value(&self, number: Exact) -> Value {
        Value::Quantity(Quantity {
            number,
            ..self.from.clone()
        })
    }

    /// A number with the digits that matter, never beyond the ends.
    fn short(&self, number: &Exact) -> Option<Exact> {
        let width = self.to.number.checked_sub(&self.from.number)?.abs();
        let mut grain = i32::MAX;
        if !width.is_zero() {
            grain = power_of_ten(&width)? - 6;
        }
        if self.log {
            grain = grain.min(power_of_ten(&number.abs())? - 5);
        }
        if grain == i32::MAX {
            return Some(self.from.number);
        }
        let (low, high) = (
            self.from.number.min(self.to.number),
            self.from.number.max(self.to.number),
        );
        Some(rounded(number, grain)?.clamp(low, high))
    }
}

fn too_fine() -> Problem {
    Problem::new("the values of this range have more digits than a study keeps")
}

/// The values of a range, both ends included.
///
/// # Errors
/// When the steps do not lead from one end to the other.
pub fn range(range: &Range, step: &Step) -> Result<Vec<Value>, Problem> {
    match step {
        Step::By(by) => stepped(range, by),
        Step::Count(count) => counted(range, *count),
    }
}

fn stepped(range: &Range, by: &Quantity) -> Result<Vec<Value>, Problem> {
    if range.log {
        return Err(Problem::new("a logarithmic range has no `by`").expected("`count`"));
    }
    let by = by
        .as_step_of(&range.from)
        .map_err(|p| Problem::new(format!("`by` does not fit: {}", p.message)))?;
    let (from, to) = (&range.from.number, &range.to.number);
    let way = to.checked_sub(from).ok_or_else(too_fine)?;
    let text = |n: &Exact| {
        Quantity {
            number: *n,
            ..range.from.clone()
        }
        .text()
    };
    if by.number.is_zero() {
        return Err(Problem::new("`by` is zero").expected("a step other than zero"));
    }
    let steps = way.checked_div(&by.number).ok_or_else(too_fine)?;
    if steps.is_negative() {
        return Err(Problem::new(format!(
            "steps of {} lead away from {}",
            by.text(),
            range.to.text()
        ))
        .help(format!("write `by: {}`", text(&-by.number))));
    }
    if !steps.is_integer() {
        let last = by.number.checked_mul(&steps.floor());
        let last = last
            .and_then(|w| from.checked_add(&w))
            .ok_or_else(too_fine)?;
        return Err(Problem::new(format!(
            "steps of {} from {} lead to {} and then beyond {}",
            by.text(),
            range.from.text(),
            text(&last),
            range.to.text()
        ))
        .expected("a step that leads to `to`, which is one of the values")
        .help(format!("write `to: {}`, or give `count`", text(&last))));
    }
    let n = u32::try_from(steps.to_integer())
        .ok()
        .filter(|n| *n < MOST)
        .ok_or_else(too_many)?;
    let one = |i: u32| {
        let way = by.number.checked_mul(&Exact::from_integer(i.into()))?;
        Some(range.value(from.checked_add(&way)?))
    };
    (0..=n).map(one).collect::<Option<_>>().ok_or_else(too_fine)
}

fn too_many() -> Problem {
    Problem::new(format!("a range of more than {MOST} values"))
}

fn counted(range: &Range, count: u32) -> Result<Vec<Value>, Problem> {
    let same = range.from.number == range.to.number;
    if count == 0 || (count == 1 && !same) || (count > 1 && same) {
        return Err(Problem::new(format!(
            "`count: {count}` for a range from {} to {}",
            range.from.text(),
            range.to.text()
        ))
        .expected("at least 2: both ends are values"));
    }
    if count > MOST {
        return Err(too_many());
    }
    let one = |i: u32| match i {
        0 => Ok(range.value(range.from.number)),
        i if i + 1 == count => Ok(range.value(range.to.number)),
        i if range.log => range.at(f64::from(i) / f64::from(count - 1)),
        i => {
            let part = Exact::new(i.into(), (count - 1).into());
            let (from, to) = (&range.from.number, &range.to.number);
            let way = to.checked_sub(from).and_then(|w| w.checked_mul(&part));
            let number = way
                .and_then(|w| from.checked_add(&w))
                .ok_or_else(too_fine)?;
            // What ends after few digits is kept as it is.
            let ends = rounded(&number, -9) == Some(number);
            let number = if ends {
                number
            } else {
                range.short(&number).ok_or_else(too_fine)?
            };
            Ok(range.value(number))
        }
    };
    (0..count).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(from: &str, to: &str, step: &str, log: bool) -> Result<Vec<String>, Problem> {
        let q = |t: &str| Quantity::read(t).unwrap().unwrap();
        let parted = Range::new(q(from), &q(to), log)?;
        let step = match step.strip_prefix('#') {
            Some(n) => Step::Count(n.parse().unwrap()),
            None => Step::By(q(step)),
        };
        let values = range(&parted, &step)?;
        Ok(values.iter().map(Value::text).collect())
    }

    #[test]
    fn both_ends_are_values_and_all_are_as_people_write_them() {
        let deg = of("0 deg", "90 deg", "5 deg", false).unwrap();
        assert_eq!(
            (deg.len(), deg[1].as_str(), deg[18].as_str()),
            (19, "5 deg", "90 deg")
        );
        assert_eq!(
            of("0.05", "0.2", "0.05", false).unwrap(),
            ["0.05", "0.1", "0.15", "0.2"]
        );
        assert_eq!(
            of("1 cm", "0 mm", "-5 mm", false).unwrap(),
            ["1 cm", "0.5 cm", "0 cm"]
        );
        assert_eq!(
            of("0", "1", "#4", false).unwrap(),
            ["0", "0.333333", "0.666667", "1"]
        );
        assert_eq!(
            of("0", "1", "#5", false).unwrap(),
            ["0", "0.25", "0.5", "0.75", "1"]
        );
        assert_eq!(
            of("1", "1000", "#4", true).unwrap(),
            ["1", "10", "100", "1000"]
        );
        for by in ["10 degC", "10 K"] {
            assert_eq!(
                of("20 degC", "40 degC", by, false).unwrap(),
                ["20 degC", "30 degC", "40 degC"]
            );
        }
        assert!(of("1 degC", "40 degC", "#3", true).is_err());
        assert_eq!(of("1 kPa", "1 MPa", "#3", true).unwrap()[1], "31.6228 kPa");
    }

    #[test]
    fn a_step_that_misses_the_end_is_refused_with_what_to_do() {
        let e = of("0 deg", "90 deg", "20 deg", false).unwrap_err();
        assert!(
            e.message.contains("lead to 80 deg and then beyond 90 deg"),
            "{e}"
        );
        assert!(e.help.unwrap().contains("`to: 80 deg`"));
        assert!(
            of("0 deg", "90 deg", "-5 deg", false)
                .unwrap_err()
                .help
                .unwrap()
                .contains("`by: 5 deg`")
        );
        assert!(of("0", "1", "0", false).is_err());
        assert!(of("0", "1", "#1", false).is_err());
        assert!(of("0", "1", "#3", true).is_err());
        assert!(of("0 mm", "1 s", "1 mm", false).is_err());
        assert!(of("0", "1", "1e-9", false).is_err());
        // Never a number that has gone round.
        for step in ["#3", "1e30"] {
            let e = of("0.123456789012345678901234567891", "1e30", step, false).unwrap_err();
            assert!(
                e.message.contains("more digits") || e.message.contains("beyond"),
                "{e}"
            );
        }
    }
}
