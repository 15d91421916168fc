//! Decimal numbers as programs of any country write them.

use std::borrow::Cow;

/// The sign between the whole and the rest of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decimal {
    /// `1.5`
    Point,
    /// `1,5`
    Comma,
}

/// A number in the form that programs agree on (`-1.5e3`), with whatever it was written in: a comma for the point, `D` for the `e` of its
/// power, a minus sign of a typesetter. `None` where it is no finite decimal number, or has signs between its thousands.
pub fn plain(text: &str, decimal: Decimal) -> Option<Cow<'_, str>> {
    let text = text.trim();
    let mut written = Cow::Borrowed(text);
    if decimal == Decimal::Comma && text.contains(',') {
        if text.contains('.') || text.matches(',').count() > 1 {
            return None;
        }
        written = Cow::Owned(text.replace(',', "."));
    }
    if written.contains(['d', 'D', '\u{2212}']) {
        written = Cow::Owned(written.replace(['d', 'D'], "e").replace('\u{2212}', "-"));
    }
    // Words such as `inf` are numbers to Rust.
    let letters = |b: u8| matches!(b, b'0'..=b'9' | b'.' | b'+' | b'-' | b'e' | b'E');
    if !written.bytes().all(letters) || written.ends_with(['e', 'E']) {
        return None;
    }
    written.parse::<f64>().ok().filter(|v| v.is_finite())?;
    Some(written)
}

/// The value of a number: see [`plain`].
pub fn value(text: &str, decimal: Decimal) -> Option<f64> {
    plain(text, decimal)?.parse().ok()
}

/// What a file's numbers say of its decimal sign.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Signs {
    /// First line, and number, with a point.
    pub point: Option<(usize, String)>,
    /// First with a comma that can be a decimal sign alone.
    pub comma: Option<(usize, String)>,
    /// First with a comma before just three digits: perhaps a sign between thousands.
    pub unclear: Option<(usize, String)>,
}

impl Signs {
    /// Notes a number of a line.
    pub fn note(&mut self, line: usize, text: &str) {
        let first = |kept: &mut Option<(usize, String)>| {
            if kept.is_none() {
                *kept = Some((line, text.trim().to_owned()));
            }
        };
        if text.contains(',') {
            match comma_is_decimal(text.trim()) {
                Some(true) => first(&mut self.comma),
                Some(false) => {}
                None => first(&mut self.unclear),
            }
        } else if text.contains('.') && value(text, Decimal::Point).is_some() {
            first(&mut self.point);
        }
    }

    /// The file's sign.
    ///
    /// # Errors
    /// Line and sentence, where it has both, or where what it has may mean a thousand times as much.
    pub fn decide(&self) -> Result<Decimal, (usize, String)> {
        let shown = |s: &(usize, String)| crate::text::shown(&s.1);
        match (&self.point, &self.comma, &self.unclear) {
            (_, None, None) => Ok(Decimal::Point),
            (Some(p), Some(c), _) | (Some(p), None, Some(c)) => Err((
                c.0,
                format!(
                    "`{}` has a comma, and `{}` in line {} a point: one of them is no decimal sign; write all numbers with a \
                     point, and without a sign between thousands",
                    shown(c),
                    shown(p),
                    p.0
                ),
            )),
            (None, Some(_), _) => Ok(Decimal::Comma),
            (None, None, Some(u)) => Err((
                u.0,
                format!(
                    "the comma of `{}` may be a decimal sign or stand between thousands, and no number of the file tells which; \
                     write its numbers with a decimal point",
                    shown(u)
                ),
            )),
        }
    }
}

/// Whether the comma of a text is a decimal sign: `None` where it may stand between thousands, `Some(false)` where the text is no number.
fn comma_is_decimal(text: &str) -> Option<bool> {
    if value(text, Decimal::Comma).is_none() {
        return Some(false);
    }
    let (whole, rest) = text.split_once(',')?;
    let whole = whole.trim_start_matches(['-', '+', '\u{2212}']);
    let thousands = rest.len() == 3
        && rest.bytes().all(|b| b.is_ascii_digit())
        && (1..=3).contains(&whole.len())
        && !whole.starts_with('0');
    if thousands { None } else { Some(true) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_in_the_forms_of_the_field() {
        for (text, want) in [
            ("1.5", 1.5),
            (" -1.5e3 ", -1500.0),
            ("+.5", 0.5),
            ("5.", 5.0),
            ("1.0D+02", 100.0),
            ("\u{2212}3", -3.0),
        ] {
            assert_eq!(value(text, Decimal::Point), Some(want), "{text}");
        }
        assert_eq!(value("1,5E-1", Decimal::Comma), Some(0.15));
        assert_eq!(value("15", Decimal::Comma), Some(15.0));
        for text in [
            "", "nan", "inf", "1e", "1e999", "1.2.3", "0x1", "1 2", "1,5", "e5", "d",
        ] {
            assert_eq!(value(text, Decimal::Point), None, "{text}");
        }
        for text in ["1.234,5", "1,234,567", ","] {
            assert_eq!(value(text, Decimal::Comma), None, "{text}");
        }
    }

    #[test]
    fn the_sign_is_told_by_all_numbers_of_a_file_and_never_guessed() {
        let decide = |texts: &[&str]| {
            let mut signs = Signs::default();
            texts
                .iter()
                .enumerate()
                .for_each(|(i, t)| signs.note(i + 1, t));
            signs.decide()
        };
        assert_eq!(decide(&["1", "2"]), Ok(Decimal::Point));
        assert_eq!(decide(&["1.500", "2"]), Ok(Decimal::Point));
        assert_eq!(decide(&["0,000", "1,500"]), Ok(Decimal::Comma));
        assert_eq!(decide(&["1,234", "12,5"]), Ok(Decimal::Comma));
        assert_eq!(decide(&["1,234e-3"]), Ok(Decimal::Comma));
        assert_eq!(decide(&["1", "1,234"]).unwrap_err().0, 2);
        assert_eq!(decide(&["0.5", "1,234"]).unwrap_err().0, 2);
        assert_eq!(decide(&["0,5", "1.5"]).unwrap_err().0, 1);
    }
}
