//! From text to SI number.
//!
//! Grammar: `number unit`; `unit = factor ((" " | "*" | "." | "·" | "/") factor)*`, read from left to
//! right, `/` divides by the next factor only; `factor = symbol power?`; `power = "2" | "^2" | "-2" |
//! "²"`. A leading `1` stands for "nothing above the stroke": `0.004 1/mm`.

use crate::nearest::nearest;
use crate::units::dimension::{Dimension, Exponents, UnitError, si_number};
use crate::units::symbols::{ALIASES, COMPOUND, FOREIGN, PREFIXES, SYMBOLS, Symbol};

/// A unit, reduced to SI: value = number x 10^`decimal` x `numerator` / `denominator` x (pi/180)^`degrees` + `offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Exponents of the base units.
    pub exponents: Exponents,
    decimal: i32,
    numerator: u64,
    denominator: u64,
    degrees: i32,
    offset: f64,
}

impl Unit {
    const ONE: Unit = Unit {
        exponents: [0; 5],
        decimal: 0,
        numerator: 1,
        denominator: 1,
        degrees: 0,
        offset: 0.0,
    };

    /// Whether values of it do not begin at the zero of its dimension (`degC`): such values cannot be added or scaled.
    pub fn has_offset(&self) -> bool {
        self.offset != 0.0
    }

    /// What a number in this unit is multiplied by to be in another one: 10^a x b / c. `None` where that is no ratio of whole
    /// numbers (degrees and radians), or the two have no zero in common.
    pub fn factor_to(&self, other: &Unit) -> Option<(i32, u128, u128)> {
        let same = self.exponents == other.exponents
            && self.degrees == other.degrees
            && self.offset == other.offset;
        let [a, b] = [self.numerator, self.denominator].map(u128::from);
        let [c, d] = [other.numerator, other.denominator].map(u128::from);
        let ratio = (
            self.decimal.checked_sub(other.decimal)?,
            a.checked_mul(d)?,
            b.checked_mul(c)?,
        );
        same.then_some(ratio)
    }

    /// Multiplies by a symbol to a power; `None` when a factor or exponent overflows.
    fn times(&mut self, symbol: &Symbol, prefix: i32, power: i32) -> Option<()> {
        for (e, s) in self.exponents.iter_mut().zip(symbol.5) {
            let add = i32::from(s).checked_mul(power)?;
            *e = i8::try_from(i32::from(*e).checked_add(add)?).ok()?;
        }
        self.decimal = self
            .decimal
            .checked_add((symbol.2 + prefix).checked_mul(power)?)?;
        self.degrees = self.degrees.checked_add(symbol.4.checked_mul(power)?)?;
        let factor = symbol.3.checked_pow(power.unsigned_abs())?;
        let side = if power > 0 {
            &mut self.numerator
        } else {
            &mut self.denominator
        };
        *side = side.checked_mul(factor)?;
        if let Some((_, by)) = COMPOUND.iter().find(|c| c.0 == symbol.0) {
            let by = by.checked_pow(power.unsigned_abs())?;
            let side = if power > 0 {
                &mut self.denominator
            } else {
                &mut self.numerator
            };
            *side = side.checked_mul(by)?;
        }
        Some(())
    }
}

/// Reads a unit such as `N/m` or `kg/m3`; the empty text and `1` are dimensionless.
///
/// # Errors
/// [`UnitError::UnknownUnit`] with the symbol that is not known.
pub fn parse_unit(text: &str) -> Result<Unit, UnitError> {
    read_unit(text).map_err(|unit| unknown(text, text, unit, None, None))
}

/// Reads a unit of a dimension, such as that of a column.
///
/// # Errors
/// [`UnitError::UnknownUnit`] with what was probably meant, of this dimension; [`UnitError::WrongDimension`].
pub fn parse_unit_of(text: &str, dimension: Dimension) -> Result<Unit, UnitError> {
    let wanted = dimension.exponents();
    let unit =
        read_unit(text).map_err(|unit| unknown(text, text, unit, Some(wanted), Some(dimension)))?;
    if unit.exponents != wanted {
        return Err(UnitError::WrongDimension {
            text: text.trim().into(),
            got: in_words(unit.exponents),
            dimension,
        });
    }
    Ok(unit)
}

/// What is said of a text whose unit `whole` has a part that is not known. What is offered has the wanted dimension, where one is wanted.
fn unknown(
    text: &str,
    whole: &str,
    unit: String,
    wanted: Option<Exponents>,
    dimension: Option<Dimension>,
) -> UnitError {
    // In its place, so that `N/mn` is offered a length and `mn` alone a force.
    let fits = |name: &str| {
        if whole.len() > 200 {
            return false;
        }
        let meant = whole.replacen(&unit, name, 1);
        read_unit(&meant).is_ok_and(|u| wanted.is_none_or(|w| u.exponents == w))
    };
    let alone = whole.trim() == unit;
    let foreign = FOREIGN
        .iter()
        .find(|f| f.0.to_lowercase() == unit.to_lowercase());
    let text = text.chars().take(80).collect();
    if let Some((_, write, exponents)) = foreign
        && (!alone || wanted.is_none_or(|w| w == *exponents))
    {
        return UnitError::Foreign {
            text,
            unit,
            write,
            dimension,
        };
    }
    let lower = unit.to_lowercase();
    let alias = ALIASES.iter().find(|(a, u)| *a == lower && fits(u));
    let nearest = alias.map(|(_, u)| (*u).to_owned()).or_else(|| {
        let mut names: Vec<String> = vec!["degC".into()];
        for s in SYMBOLS.iter().filter(|s| s.0 != "1" && s.0 != "%") {
            names.push(s.0.into());
            if s.1 {
                names.extend(PREFIXES.iter().map(|(p, _)| format!("{p}{}", s.0)));
            }
        }
        names.retain(|n| fits(n));
        nearest(&unit, names.iter().map(String::as_str)).map(str::to_owned)
    });
    UnitError::UnknownUnit {
        text,
        unit,
        nearest,
        dimension,
    }
}

/// Reads a unit; the error is the part that is not known.
fn read_unit(text: &str) -> Result<Unit, String> {
    let mut unit = Unit::ONE;
    let mut rest = text.trim();
    if rest == "degC" || rest == "°C" {
        return Ok(Unit {
            exponents: [0, 0, 0, 1, 0],
            offset: 273.15,
            ..Unit::ONE
        });
    }
    let mut first = true;
    let mut divide = false;
    while !rest.is_empty() {
        let (symbol, prefix, power, after) = factor(rest).ok_or_else(|| first_word(rest))?;
        // `1` is no unit; it only stands above a stroke.
        if symbol.0 == "1" && !(first && (after.trim_start().starts_with('/') || after.is_empty()))
        {
            return Err(first_word(rest));
        }
        let power = if divide { -power } else { power };
        unit.times(symbol, prefix, power)
            .ok_or_else(|| first_word(rest))?;
        (divide, rest) = separator(after).ok_or_else(|| first_word(after))?;
        first = false;
    }
    if divide { Err("/".into()) } else { Ok(unit) }
}

/// What follows a factor: (whether the next one divides, the rest).
fn separator(text: &str) -> Option<(bool, &str)> {
    let trimmed = text.trim_start();
    if trimmed.is_empty() {
        return Some((false, ""));
    }
    for c in ['*', '.', '·', '/'] {
        if let Some(rest) = trimmed.strip_prefix(c) {
            // A trailing sign with nothing behind it is no unit.
            let rest = rest.trim_start();
            return (!rest.is_empty()).then_some((c == '/', rest));
        }
    }
    (trimmed.len() < text.len()).then_some((false, trimmed))
}

fn first_word(text: &str) -> String {
    let end = text
        .find([' ', '*', '/', '·'])
        .filter(|&e| e > 0)
        .unwrap_or(text.len());
    text[..end].chars().take(40).collect()
}

/// One factor at the start of the text: symbol, prefix, power, rest.
fn factor(text: &str) -> Option<(&'static Symbol, i32, i32, &str)> {
    let one = text.strip_prefix('1');
    let letters = text
        .find(|c: char| !(c.is_alphabetic() || c == '°' || c == '%' || c == 'µ'))
        .unwrap_or(text.len());
    let (name, rest) = match one {
        Some(rest) => ("1", rest),
        None => text.split_at(letters),
    };
    let (symbol, prefix) = symbol(name)?;
    let (power, rest) = power(rest)?;
    Some((symbol, prefix, power, rest))
}

fn symbol(name: &str) -> Option<(&'static Symbol, i32)> {
    if let Some(s) = SYMBOLS.iter().find(|s| s.0 == name) {
        return Some((s, 0));
    }
    PREFIXES.iter().find_map(|(p, decimal)| {
        let rest = name.strip_prefix(p)?;
        SYMBOLS
            .iter()
            .find(|s| s.1 && s.0 == rest)
            .map(|s| (s, *decimal))
    })
}

/// A power at the start of the text (1 when there is none) and the rest.
fn power(text: &str) -> Option<(i32, &str)> {
    const RAISED: &str = "⁰¹²³⁴⁵⁶⁷⁸⁹";
    let raised = |c: char| RAISED.chars().position(|r| r == c);
    if text.starts_with(|c| c == '⁻' || raised(c).is_some()) {
        let negative = text.starts_with('⁻');
        let digits = text.trim_start_matches('⁻');
        let d = digits.chars().next().and_then(raised)? as i32;
        let rest = digits
            .char_indices()
            .nth(1)
            .map_or("", |(i, _)| &digits[i..]);
        return small(if negative { -d } else { d }, rest);
    }
    let caret = text.strip_prefix('^');
    let body = caret.unwrap_or(text);
    let sign = body.strip_prefix('-');
    let digits = sign.unwrap_or(body);
    let end = digits
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(digits.len());
    if end == 0 {
        return (caret.is_none() && sign.is_none()).then_some((1, text));
    }
    let d: i32 = digits[..end].parse().ok()?;
    small(if sign.is_some() { -d } else { d }, &digits[end..])
}

/// Units have small powers; anything else is a slip such as `5 m25`.
fn small(power: i32, rest: &str) -> Option<(i32, &str)> {
    (power != 0 && power.abs() <= 6).then_some((power, rest))
}

/// A decimal number as its digits, without rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Digits<'a> {
    /// Whether it has a minus sign.
    pub negative: bool,
    /// Digits in front of the point, perhaps none.
    pub whole: &'a str,
    /// Digits behind the point, perhaps none.
    pub fraction: &'a str,
    /// Power of ten, clamped to what no double reaches.
    pub exponent: i64,
}

/// Splits `text` into number and rest; `None` when it does not begin with a number.
pub fn digits(text: &str) -> Option<(Digits<'_>, &str)> {
    let negative = text.starts_with('-');
    let body = text.strip_prefix(['-', '+']).unwrap_or(text);
    let digits = |s: &str| s.find(|c: char| !c.is_ascii_digit()).unwrap_or(s.len());
    let (whole, mut rest) = body.split_at(digits(body));
    let mut fraction = "";
    if let Some(r) = rest.strip_prefix('.') {
        let n = digits(r);
        if n > 0 || !whole.is_empty() {
            (fraction, rest) = r.split_at(n);
        }
    }
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let mut exponent = 0;
    if let Some(r) = rest.strip_prefix(['e', 'E']) {
        let body = r.strip_prefix(['-', '+']).unwrap_or(r);
        let n = digits(body);
        if n > 0 {
            // Far beyond the range of doubles either way; clamped so that nothing overflows.
            let e = body[..n].parse::<i64>().unwrap_or(100_000).min(100_000);
            exponent = if r.starts_with('-') { -e } else { e };
            rest = &body[n..];
        }
    }
    Some((
        Digits {
            negative,
            whole,
            fraction,
            exponent,
        },
        rest,
    ))
}

impl Digits<'_> {
    /// The number times the unit, rounded as rarely as possible: powers of ten and integer factors are
    /// applied to the decimal digits.
    fn times(&self, unit: &Unit) -> f64 {
        let digits = format!("{}{}", self.whole, self.fraction);
        let exponent = self.exponent + i64::from(unit.decimal) - self.fraction.len() as i64;
        let exact = digits
            .parse::<u128>()
            .ok()
            .and_then(|d| d.checked_mul(unit.numerator.into()));
        let mut value: f64 = match exact {
            Some(d) => format!("{d}e{exponent}").parse().unwrap_or(f64::NAN),
            None => {
                let d: f64 = format!("{digits}e{exponent}").parse().unwrap_or(f64::NAN);
                d * unit.numerator as f64
            }
        };
        value /= unit.denominator as f64;
        for _ in 0..unit.degrees.abs() {
            value = if unit.degrees > 0 {
                value.to_radians()
            } else {
                value.to_degrees()
            };
        }
        if self.negative {
            value = -value;
        }
        // Adding zero turns -0 into 0: the same quantity has one key.
        value + unit.offset
    }
}

/// Reads a quantity of a dimension and returns its SI value.
///
/// Dimensionless quantities may be a plain number or carry `%`; all others need a unit.
///
/// # Errors
/// A [`UnitError`] that says what was given, what was expected and an example.
pub fn parse_quantity(text: &str, dimension: Dimension) -> Result<f64, UnitError> {
    let wanted = Some(dimension.exponents());
    let (value, exponents, has_unit) = read_quantity(text, wanted, Some(dimension))?;
    if !has_unit && dimension != Dimension::Dimensionless {
        return Err(UnitError::MissingUnit {
            text: text.trim().into(),
            dimension: Some(dimension),
        });
    }
    if exponents != dimension.exponents() {
        let got = in_words(exponents);
        return Err(UnitError::WrongDimension {
            text: text.trim().into(),
            got,
            dimension,
        });
    }
    Ok(value)
}

/// Reads a quantity whose dimension is that of `unit` (for results, whose unit is any text) and returns
/// its SI value.
///
/// # Errors
/// As [`parse_quantity`]; also when `unit` itself is not known.
pub fn parse_quantity_in(text: &str, unit: &str) -> Result<f64, UnitError> {
    let wanted = parse_unit(unit)?.exponents;
    if let Some(dimension) = Dimension::of(wanted) {
        return parse_quantity(text, dimension);
    }
    let (value, exponents, has_unit) = read_quantity(text, Some(wanted), None)?;
    let text: String = text.trim().into();
    if !has_unit {
        return Err(UnitError::MissingUnit {
            text,
            dimension: None,
        });
    }
    if exponents != wanted {
        return Err(UnitError::UnknownUnit {
            text,
            unit: in_words(exponents),
            nearest: Some(unit.into()),
            dimension: None,
        });
    }
    Ok(value)
}

fn read_quantity(
    text: &str,
    wanted: Option<Exponents>,
    dimension: Option<Dimension>,
) -> Result<(f64, Exponents, bool), UnitError> {
    let text = text.trim();
    let bad = || UnitError::BadNumber {
        text: text.chars().take(80).collect(),
        dimension,
    };
    let (number, rest) = digits(text).ok_or_else(bad)?;
    if let Some(written) = without_comma(text, rest) {
        return Err(UnitError::Comma {
            text: text.chars().take(80).collect(),
            written,
            dimension,
        });
    }
    let rest = rest.trim();
    // `4/mm` reads as `4 1/mm`.
    let whole = match rest.strip_prefix('/') {
        Some(below) if !below.is_empty() => format!("1/{below}"),
        _ => rest.to_owned(),
    };
    let unit = read_unit(&whole).map_err(|unit| unknown(text, &whole, unit, wanted, dimension))?;
    let value = number.times(&unit);
    if !value.is_finite() {
        return Err(UnitError::TooLarge {
            text: text.chars().take(80).collect(),
        });
    }
    Ok((value, unit.exponents, !rest.is_empty()))
}

/// What was meant by a number with a comma, such as `5,5 mm`: `rest` is what follows the digits before it. `None`
/// where there is no comma before a digit.
fn without_comma(text: &str, rest: &str) -> Option<Vec<String>> {
    let after = rest
        .strip_prefix(',')
        .filter(|r| r.starts_with(|c: char| c.is_ascii_digit()))?;
    let before = text.strip_suffix(rest)?;
    let digits = |s: &str| s.chars().take_while(char::is_ascii_digit).count();
    let after_digits = &after[digits(after)..];
    let mut written = Vec::new();
    // `1,234.5` and `1,234,567` have more than one sign: no decimals then.
    if !after_digits.starts_with(['.', ',']) {
        written.push(format!("{before}.{after}"));
    }
    // Three digits may be thousands, but not after `0`.
    if digits(after) == 3 && before.trim_start_matches(['-', '+']) != "0" {
        written.push(format!("{before}{}", after.replace(',', "")));
    }
    (!written.is_empty()).then_some(written)
}

/// Why a unit is no plain one of SI.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SiError {
    /// It is a multiple of one.
    #[error("1 `{unit}` is {value} in SI units; expected the SI unit, and numbers in it")]
    Multiple {
        /// As given.
        unit: String,
        /// One of it in SI.
        value: f64,
    },
    /// It is no unit.
    #[error(transparent)]
    NoUnit(#[from] UnitError),
}

/// Whether a unit is a plain one of SI: artifacts hold no other numbers.
///
/// # Errors
/// What the unit is in SI, or why it is none.
pub fn check_si(unit: &str) -> Result<(), SiError> {
    match parse_quantity_in(&format!("1 {unit}"), unit)? {
        1.0 => Ok(()),
        value => Err(SiError::Multiple {
            unit: unit.to_owned(),
            value,
        }),
    }
}

/// The plain number that a text means though it is not written as one: `1 %` is `0.01`, `0,5` is `0.5`. `None` for
/// anything else.
pub fn plain_number(text: &str) -> Option<String> {
    match parse_quantity(text, Dimension::Dimensionless) {
        Ok(value) => Some(si_number(value)),
        Err(UnitError::Comma { written, .. }) => match &written[..] {
            [one] => plain_number(one),
            _ => None,
        },
        Err(_) => None,
    }
}

/// A dimension in words: "a time", or its base units.
fn in_words(exponents: Exponents) -> String {
    if let Some(d) = Dimension::of(exponents) {
        return d.with_article().into();
    }
    let parts: Vec<String> = ["m", "kg", "s", "K", "rad"]
        .iter()
        .zip(exponents)
        .filter(|(_, e)| *e != 0)
        .map(|(n, e)| {
            if e == 1 {
                (*n).to_owned()
            } else {
                format!("{n}^{e}")
            }
        })
        .collect();
    format!("a quantity in {}", parts.join(" "))
}
