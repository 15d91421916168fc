//! SI values in the units in which forming is talked about.

/// Factor from SI to the unit shown, and that unit.
pub(crate) fn shown(unit: &str) -> (f64, &str) {
    match unit {
        "m" => (1e3, "mm"),
        "m2" => (1e6, "mm²"),
        "m3" => (1e9, "mm³"),
        "rad" => (180.0 / std::f64::consts::PI, "deg"),
        "1/m" => (1e-3, "1/mm"),
        "Pa" => (1e-3, "kPa"),
        "1" => (1.0, ""),
        other => (1.0, other),
    }
}

/// A value (SI) as people read it, and the unit in which it is told; that is empty where there is none.
#[must_use]
pub fn in_users_units(value: f64, unit: &str, digits: i32) -> (String, String) {
    let (factor, name) = shown(unit);
    (number(value * factor, digits), name.to_owned())
}

/// A number as people read it: `digits` significant digits, no trailing zeros.
pub(crate) fn number(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 {
            "0".into()
        } else {
            value.to_string()
        };
    }
    let size = value.abs().log10().floor() as i32;
    if !(-4..9).contains(&size) {
        let places = (digits - 1).max(0) as usize;
        return format!("{value:.places$e}");
    }
    let places = (digits - 1 - size).clamp(0, 12) as usize;
    trim(format!("{value:.places$}"))
}

/// A number with a fixed number of places, for columns; no minus zero.
pub(crate) fn fixed(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    let nought = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    if nought {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    }
}

/// Without zeros at the end behind the point.
pub(crate) fn trim(text: String) -> String {
    if text.contains('.') {
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    text
}

/// A value with its unit: `68 mm`.
pub(crate) fn quantity(value: f64, unit: &str, digits: i32) -> String {
    let (factor, name) = shown(unit);
    join(number(value * factor, digits), name)
}

/// A difference with its sign and unit: `+3 mm`, `−1.5 mm`.
pub(crate) fn signed(value: f64, unit: &str) -> String {
    let text = quantity(value, unit, 3);
    if value > 0.0 {
        format!("+{text}")
    } else {
        text.replacen('-', "−", 1)
    }
}

/// A number text and a unit, if there is one.
pub(crate) fn join(number: String, unit: &str) -> String {
    if unit.is_empty() {
        number
    } else {
        format!("{number} {unit}")
    }
}

/// A duration: `420 ms`, `12.3 s`, `4 min 05 s`, `2 h 03 min`.
pub(crate) fn duration(seconds: f64) -> String {
    let s = seconds.max(0.0);
    if s < 0.9995 {
        return format!("{} ms", number(s * 1e3, 3));
    }
    if s < 60.0 {
        return format!("{} s", number(s, 3));
    }
    let whole = s.round() as u64;
    if whole < 3600 {
        return format!("{} min {:02} s", whole / 60, whole % 60);
    }
    format!("{} h {:02} min", whole / 3600, whole % 3600 / 60)
}

/// A moment (s since 1970-01-01 UTC): `2026-03-04 12:34 UTC`.
pub(crate) fn moment(seconds: f64) -> String {
    let minutes = (seconds / 60.0).floor() as i64;
    let (hour, minute) = (
        minutes.div_euclid(60).rem_euclid(24),
        minutes.rem_euclid(60),
    );
    let [year, month, day] = date(minutes.div_euclid(24 * 60));
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

/// Year, month and day by days since 1970-01-01. Years are counted from March on, so that a leap day is the last of its year.
fn date(days: i64) -> [i64; 3] {
    const DAYS_OF_400_YEARS: i64 = 146_097;
    // From 0000-03-01 on.
    let days = days.saturating_add(719_468);
    let left = days.rem_euclid(DAYS_OF_400_YEARS);
    let year = (left - left / 1460 + left / 36_524 - left / (DAYS_OF_400_YEARS - 1)) / 365;
    let left = left - (365 * year + year / 4 - year / 100);
    // Five months from March or August on have 153 days.
    let month = (5 * left + 2) / 153;
    let day = left - (153 * month + 2) / 5 + 1;
    let since_january = (month + 2) % 12;
    let year = 400 * days.div_euclid(DAYS_OF_400_YEARS) + year + i64::from(month > 9);
    [year, since_january + 1, day]
}

/// A size in bytes as people read it.
pub fn bytes(n: u64) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB"];
    let (mut value, mut unit) = (n as f64, 0);
    while value >= 1024.0 && unit + 1 < units.len() {
        value /= 1024.0;
        unit += 1;
    }
    if unit == 0 {
        format!("{n} B")
    } else {
        format!("{value:.1} {}", units[unit])
    }
}

/// A count with thin separators: `12 345 678`.
pub(crate) fn count(n: f64) -> String {
    let digits = format!("{:.0}", n.abs());
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(c);
    }
    if n < 0.0 { format!("-{out}") } else { out }
}

/// Plural with its number: `1 zone`, `3 zones`, `2 areas of bridging`.
pub(crate) fn plural(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_angles_and_curvatures_are_shown_in_the_units_of_the_trade() {
        assert_eq!(quantity(0.068, "m", 3), "68 mm");
        assert_eq!(quantity(0.139_626, "rad", 3), "8 deg");
        assert_eq!(quantity(100.0, "1/m", 3), "0.1 1/mm");
        assert_eq!(quantity(1e5, "Pa", 4), "100 kPa");
        assert_eq!(quantity(3.0, "1", 4), "3");
    }

    #[test]
    fn numbers_have_no_minus_zero_and_no_trailing_zeros() {
        assert_eq!(number(-0.0, 3), "0");
        assert_eq!(fixed(-0.0001, 2), "0.00");
        assert_eq!(fixed(-0.5, 2), "-0.50");
        assert_eq!(number(1.500, 4), "1.5");
        assert_eq!(number(2.0e-9, 3), "2.00e-9");
        assert_eq!(count(1_234_567.0), "1\u{202f}234\u{202f}567");
    }

    #[test]
    fn moments_are_told_as_dates_also_about_leap_days() {
        assert_eq!(moment(0.0), "1970-01-01 00:00 UTC");
        assert_eq!(moment(951_782_399.9), "2000-02-28 23:59 UTC");
        assert_eq!(moment(951_782_400.0), "2000-02-29 00:00 UTC");
        assert_eq!(moment(951_868_800.0), "2000-03-01 00:00 UTC");
        assert_eq!(moment(1_709_210_096.0), "2024-02-29 12:34 UTC");
        assert_eq!(moment(1_767_225_599.0), "2025-12-31 23:59 UTC");
        assert_eq!(moment(4_107_542_400.0), "2100-03-01 00:00 UTC");
    }

    #[test]
    fn durations_read_as_hours_minutes_or_seconds() {
        assert_eq!(duration(0.0419), "41.9 ms");
        assert_eq!(duration(0.9999), "1 s");
        assert_eq!(duration(245.2), "4 min 05 s");
        assert_eq!(duration(7384.0), "2 h 03 min");
    }
}
