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

/// A size in bytes.
pub(crate) fn bytes(n: u64) -> String {
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
    fn durations_read_as_hours_minutes_or_seconds() {
        assert_eq!(duration(0.0419), "41.9 ms");
        assert_eq!(duration(0.9999), "1 s");
        assert_eq!(duration(245.2), "4 min 05 s");
        assert_eq!(duration(7384.0), "2 h 03 min");
    }
}
