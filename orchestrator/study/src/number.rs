//! Numbers as they are written, with their units.

use crate::problem::Problem;
use num_rational::Ratio;
use num_traits::{CheckedAdd, CheckedDiv, CheckedMul, CheckedSub, Signed, Zero};
use plyflow_model::units::{
    Digits, Dimension, Exponents, Unit, digits, parse_quantity_in, parse_unit,
};

/// A number, exact.
pub type Exact = Ratio<i128>;

/// Largest power of ten that numbers of a study have, either way.
const MOST_DIGITS: u32 = 30;

/// A number with its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// In the unit.
    pub number: Exact,
    /// As it is written; empty: a plain number.
    pub unit: String,
    pub(crate) si: Unit,
}

fn ten_to(power: u32) -> Option<i128> {
    10i128.checked_pow(power)
}

/// The number that a text begins with, without a sign, and what follows it; the number is an error where it has more digits than are
/// kept.
pub(crate) fn leading(text: &str) -> Option<(Result<Exact, Problem>, &str)> {
    if text.starts_with(['-', '+']) {
        return None;
    }
    let (digits, rest) = digits(text)?;
    Some((of_digits(&digits).ok_or_else(too_large), rest))
}

/// A number of digits; `None` where there are too many.
fn of_digits(digits: &Digits<'_>) -> Option<Exact> {
    let fraction = digits.fraction.trim_end_matches('0');
    let joined = format!("{}{fraction}", digits.whole);
    let joined = joined.trim_start_matches('0');
    if joined.is_empty() {
        return Some(Exact::zero());
    }
    if joined.len() > MOST_DIGITS as usize {
        return None;
    }
    let mantissa: i128 = joined.parse().ok()?;
    let power = digits.exponent.checked_sub(fraction.len() as i64)?;
    let size = u32::try_from(power.unsigned_abs()).ok()?;
    let scale = ten_to(size).filter(|_| size <= MOST_DIGITS)?;
    let number = match power < 0 {
        true => Exact::new(mantissa, scale),
        false => Exact::from_integer(mantissa.checked_mul(scale)?),
    };
    Some(if digits.negative { -number } else { number })
}

/// The number that a text is, with a sign or without; an error where it has more digits than are kept.
pub(crate) fn exact(text: &str) -> Option<Result<Exact, Problem>> {
    let (digits, rest) = digits(text)?;
    rest.is_empty()
        .then(|| of_digits(&digits).ok_or_else(too_large))
}

/// The exact number that the shortest text of a double is.
pub(crate) fn of_double(value: f64) -> Option<Exact> {
    exact(&format!("{value:e}"))?
        .ok()
        .filter(|_| value.is_finite())
}

/// The double nearest to a number.
pub(crate) fn double(number: &Exact) -> f64 {
    match decimals(number) {
        // The text of a finite decimal is read with one rounding.
        Some(text) => text.parse().unwrap_or(f64::NAN),
        None => *number.numer() as f64 / *number.denom() as f64,
    }
}

/// A number as people write it: all its digits where they end, else as many as a double has.
pub(crate) fn text(number: &Exact) -> String {
    decimals(number).unwrap_or_else(|| plyflow_model::units::si_number(double(number)))
}

/// The digits of a number, where they end.
fn decimals(number: &Exact) -> Option<String> {
    let (mut twos, mut fives, mut rest) = (0u32, 0u32, *number.denom());
    while rest % 2 == 0 {
        (rest, twos) = (rest / 2, twos + 1);
    }
    while rest % 5 == 0 {
        (rest, fives) = (rest / 5, fives + 1);
    }
    if rest != 1 {
        return None;
    }
    let places = twos.max(fives);
    let scaled = number.checked_mul(&Exact::from_integer(ten_to(places)?))?;
    let digits = scaled.to_integer().unsigned_abs().to_string();
    let sign = if number.is_negative() { "-" } else { "" };
    if places == 0 {
        return Some(format!("{sign}{digits}"));
    }
    let places = places as usize;
    let digits = format!("{digits:0>width$}", width = places + 1);
    let (whole, fraction) = digits.split_at(digits.len() - places);
    Some(format!("{sign}{whole}.{fraction}"))
}

/// The power of ten that is the largest of those not above a positive number.
pub(crate) fn power_of_ten(number: &Exact) -> Option<i32> {
    let mut power = double(number).abs().to_string().len() as i32;
    power = power.min(MOST_DIGITS as i32);
    while power > -(MOST_DIGITS as i32) && *number < tens(power)? {
        power -= 1;
    }
    Some(power)
}

/// A power of ten.
pub(crate) fn tens(power: i32) -> Option<Exact> {
    let scale = ten_to(power.unsigned_abs())?;
    Some(match power < 0 {
        true => Exact::new(1, scale),
        false => Exact::from_integer(scale),
    })
}

/// The multiple of a power of ten that lies nearest, halves away from zero.
pub(crate) fn rounded(number: &Exact, power: i32) -> Option<Exact> {
    let grain = tens(power)?;
    number.checked_div(&grain)?.round().checked_mul(&grain)
}

fn too_large() -> Problem {
    Problem::new("the number has more digits than a study keeps")
        .expected("numbers between 1e-30 and 1e30, with at most 30 digits")
}

/// The unit of the base units alone, such as `m2*kg*s-2`.
fn base_unit(exponents: Exponents) -> String {
    let names = ["m", "kg", "s", "K", "rad"];
    let part = |(name, e): (&str, i8)| match e {
        0 => None,
        1 => Some(name.to_owned()),
        e => Some(format!("{name}{e}")),
    };
    let parts: Vec<String> = names.into_iter().zip(exponents).filter_map(part).collect();
    parts.join("*")
}

impl Quantity {
    /// A plain number.
    ///
    /// # Panics
    /// Never: the empty unit is known.
    #[must_use]
    pub fn plain(number: Exact) -> Self {
        Self::new(number, "").unwrap_or_else(|_| unreachable!("plain numbers have no unit"))
    }

    /// A number of a unit.
    ///
    /// # Errors
    /// When the unit is not known.
    pub fn new(number: Exact, unit: &str) -> Result<Self, Problem> {
        let unit = unit.trim();
        let si = parse_unit(unit).map_err(|e| Problem::new(e.reason()).help(e.help()))?;
        Ok(Self {
            number,
            unit: unit.to_owned(),
            si,
        })
    }

    /// Reads `-45 deg` or `0.3`; `None` when the text begins with no number, or its unit is not known.
    ///
    /// # Errors
    /// When the number has more digits than are kept.
    #[must_use]
    pub fn read(text: &str) -> Option<Result<Self, Problem>> {
        let text = text.trim();
        let body = text.strip_prefix(['-', '+']).unwrap_or(text).trim_start();
        let (number, rest) = leading(body)?;
        let rest = rest.trim();
        let unit = match rest.strip_prefix('/') {
            Some(below) => format!("1/{below}"),
            None => rest.to_owned(),
        };
        let one = Self::new(Exact::from_integer(1), &unit).ok()?;
        let signed = |number: Exact| Self {
            number: if text.starts_with('-') {
                -number
            } else {
                number
            },
            ..one
        };
        Some(number.map(signed))
    }

    /// Its dimension.
    #[must_use]
    pub fn exponents(&self) -> Exponents {
        self.si.exponents
    }

    /// Whether it is a number without a dimension.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.si.exponents == [0; 5]
    }

    /// Its dimension in words.
    #[must_use]
    pub fn in_words(&self) -> String {
        words(self.exponents())
    }

    /// As one writes it.
    #[must_use]
    pub fn text(&self) -> String {
        match self.unit.as_str() {
            "" => text(&self.number),
            unit => format!("{} {unit}", text(&self.number)),
        }
    }

    /// In SI.
    #[must_use]
    pub fn si(&self) -> f64 {
        match self.unit.as_str() {
            "" => double(&self.number),
            unit => parse_quantity_in(&self.text(), unit).unwrap_or(f64::NAN),
        }
    }

    /// The same in another unit of its dimension.
    ///
    /// # Errors
    /// When the dimensions differ, or the number gets too many digits.
    pub fn in_unit_of(&self, other: &Quantity) -> Result<Self, Problem> {
        if self.exponents() != other.exponents() {
            let (a, b) = (self.in_words(), other.in_words());
            return Err(Problem::new(format!("{a} and {b} do not go together"))
                .expected("quantities of one dimension"));
        }
        if self.unit == other.unit {
            return Ok(self.clone());
        }
        let exact = self
            .si
            .factor_to(&other.si)
            .and_then(|(tens_of, over, below)| {
                let ratio = Exact::new(i128::try_from(over).ok()?, i128::try_from(below).ok()?);
                self.number
                    .checked_mul(&ratio)?
                    .checked_mul(&tens(tens_of)?)
            });
        let number = match exact {
            Some(number) => number,
            // Degrees and radians, or temperatures of two scales.
            None => {
                let one = Quantity {
                    number: Exact::from_integer(1),
                    ..other.clone()
                };
                let zero = Quantity {
                    number: Exact::zero(),
                    ..other.clone()
                };
                let scale = one.si() - zero.si();
                let value = (self.si() - zero.si()) / scale;
                let digits: f64 = format!("{value:.14e}").parse().unwrap_or(value);
                of_double(digits).ok_or_else(too_large)?
            }
        };
        Ok(Self {
            number,
            ..other.clone()
        })
    }

    /// Its opposite.
    #[must_use]
    pub fn negated(&self) -> Self {
        Self {
            number: -self.number,
            ..self.clone()
        }
    }

    /// Its opposite, as a result.
    ///
    /// # Errors
    /// When its scale does not begin at zero.
    pub fn opposite(&self) -> Result<Self, Problem> {
        self.computable()?;
        Ok(self.negated())
    }

    /// How much this is as a step of `other`: 5 K and 5 degC are the same step of a temperature.
    ///
    /// # Errors
    /// As [`Quantity::in_unit_of`].
    pub fn as_step_of(&self, other: &Quantity) -> Result<Self, Problem> {
        if !other.si.has_offset() || self.si.has_offset() {
            return self.in_unit_of(other);
        }
        let kelvin = Self::new(Exact::zero(), &base_unit(other.exponents()))?;
        Ok(Self {
            number: self.in_unit_of(&kelvin)?.number,
            ..other.clone()
        })
    }

    fn computable(&self) -> Result<(), Problem> {
        if self.si.has_offset() {
            return Err(Problem::new(format!(
                "`{}` cannot be computed with: its scale does not begin at zero",
                self.text()
            ))
            .help("write it in `K`"));
        }
        Ok(())
    }

    /// The sum, in this unit.
    ///
    /// # Errors
    /// When the dimensions differ.
    pub fn plus(&self, other: &Quantity) -> Result<Self, Problem> {
        self.computable()?;
        other.computable()?;
        let other = other.in_unit_of(self)?;
        let number = self
            .number
            .checked_add(&other.number)
            .ok_or_else(too_large)?;
        Ok(Self {
            number,
            ..self.clone()
        })
    }

    /// The difference, in this unit.
    ///
    /// # Errors
    /// When the dimensions differ.
    pub fn minus(&self, other: &Quantity) -> Result<Self, Problem> {
        self.computable()?;
        other.computable()?;
        let other = other.in_unit_of(self)?;
        let number = self
            .number
            .checked_sub(&other.number)
            .ok_or_else(too_large)?;
        Ok(Self {
            number,
            ..self.clone()
        })
    }

    /// The product.
    ///
    /// # Errors
    /// When it has too many digits, or a power of a unit that nobody writes.
    pub fn times(&self, other: &Quantity) -> Result<Self, Problem> {
        self.computable()?;
        other.computable()?;
        if other.unit.is_empty() || self.unit.is_empty() {
            let unit = if self.unit.is_empty() { other } else { self };
            let number = self
                .number
                .checked_mul(&other.number)
                .ok_or_else(too_large)?;
            return Ok(Self {
                number,
                ..unit.clone()
            });
        }
        let exponents = combined(self.exponents(), other.exponents(), 1)?;
        let (a, b) = (self.to_base()?, other.to_base()?);
        let number = a.number.checked_mul(&b.number).ok_or_else(too_large)?;
        Self::new(number, &base_unit(exponents))
    }

    /// The quotient.
    ///
    /// # Errors
    /// As [`Quantity::times`]; also by zero.
    pub fn over(&self, other: &Quantity) -> Result<Self, Problem> {
        self.computable()?;
        other.computable()?;
        if other.number.is_zero() {
            return Err(Problem::new("a division by zero"));
        }
        if other.unit.is_empty() {
            let number = self
                .number
                .checked_div(&other.number)
                .ok_or_else(too_large)?;
            return Ok(Self {
                number,
                ..self.clone()
            });
        }
        if self.exponents() == other.exponents() {
            let same = self.in_unit_of(other)?;
            let number = same
                .number
                .checked_div(&other.number)
                .ok_or_else(too_large)?;
            return Ok(Self::plain(number));
        }
        let exponents = combined(self.exponents(), other.exponents(), -1)?;
        let (a, b) = (self.to_base()?, other.to_base()?);
        let number = a.number.checked_div(&b.number).ok_or_else(too_large)?;
        Self::new(number, &base_unit(exponents))
    }

    fn to_base(&self) -> Result<Self, Problem> {
        let one = Self::new(Exact::from_integer(1), &base_unit(self.exponents()))?;
        self.in_unit_of(&one)
    }

    /// How it compares with another of its dimension.
    ///
    /// # Errors
    /// When the dimensions differ.
    pub fn compare(&self, other: &Quantity) -> Result<std::cmp::Ordering, Problem> {
        Ok(self.number.cmp(&other.in_unit_of(self)?.number))
    }
}

fn combined(a: Exponents, b: Exponents, sign: i8) -> Result<Exponents, Problem> {
    let mut all = a;
    for (to, from) in all.iter_mut().zip(b) {
        *to += sign * from;
        if to.abs() > 6 {
            return Err(Problem::new("the unit of this product has a power above 6"));
        }
    }
    Ok(all)
}

/// The SI unit of a dimension.
pub(crate) fn si_unit(exponents: Exponents) -> String {
    match Dimension::of(exponents) {
        Some(d) => d.base_unit().to_owned(),
        None => base_unit(exponents),
    }
}

/// A dimension in words.
pub(crate) fn words(exponents: Exponents) -> String {
    match Dimension::of(exponents) {
        Some(d) => d.with_article().to_owned(),
        None => format!("a quantity in {}", base_unit(exponents)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn q(text: &str) -> Quantity {
        Quantity::read(text).unwrap().unwrap()
    }

    #[test]
    fn decimals_are_added_as_they_are_written() {
        assert_eq!(q("0.1").plus(&q("0.2")).unwrap().text(), "0.3");
        assert_eq!(q("-135 deg").plus(&q("45 deg")).unwrap().text(), "-90 deg");
        assert_eq!(q("1 cm").plus(&q("5 mm")).unwrap().text(), "1.5 cm");
        assert_eq!(q("1 in").minus(&q("0.4 mm")).unwrap().si(), 0.025);
    }

    #[test]
    fn units_go_through_products_and_quotients() {
        assert_eq!(q("90 deg").over(&q("45 deg")).unwrap(), q("2"));
        let work = q("2 N").times(&q("30 mm")).unwrap();
        assert_eq!((work.si(), work.exponents()), (0.06, q("1 J").exponents()));
        let slope = q("10 mm").over(&q("180 mm")).unwrap();
        assert!(slope.is_plain() && (slope.si() - 1.0 / 18.0).abs() < 1e-17);
        assert!(
            q("1 mm")
                .plus(&q("1 s"))
                .unwrap_err()
                .message
                .contains("a length")
        );
        assert!(q("20 degC").plus(&q("5 degC")).is_err());
    }

    #[test]
    fn degrees_and_radians_meet_within_the_digits_of_a_double() {
        let sum = q("0 deg").plus(&q("1 rad")).unwrap();
        assert!((sum.si() - 1.0).abs() < 1e-14, "{sum:?}");
    }

    #[test]
    fn a_text_that_is_no_quantity_is_none() {
        for text in ["", "deg", "5 mn", "a.yaml", "5,5 mm", "--5 mm", "- -5 mm"] {
            assert_eq!(Quantity::read(text), None, "{text}");
        }
    }

    #[test]
    fn a_number_with_too_many_digits_is_an_error_and_no_text() {
        let long = "1234567890123456789012345678901 mm";
        for text in ["1e99", "1e-40 m", "-2e31 deg", long] {
            let e = Quantity::read(text).unwrap().unwrap_err();
            assert!(e.message.contains("more digits"), "{text}: {e}");
        }
        assert_eq!(
            q("0000000000000000000000000000000000000000001.50").text(),
            "1.5"
        );
    }

    #[test]
    fn a_temperature_of_a_scale_that_begins_elsewhere_has_no_opposite() {
        assert!(q("20 degC").opposite().is_err());
        assert_eq!(q("5 K").as_step_of(&q("20 degC")).unwrap().text(), "5 degC");
        assert_eq!(
            q("5 degC").as_step_of(&q("20 degC")).unwrap().text(),
            "5 degC"
        );
    }
}
