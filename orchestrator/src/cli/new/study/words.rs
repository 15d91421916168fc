//! Words of a new study as a person writes them.

use plyflow_model::units::{Dimension, parse_quantity, si_number};

/// Length of one unit of a file (m), and how a scene writes it.
///
/// # Errors
/// Says what was given and what is expected.
pub fn unit(text: &str) -> Result<(f64, String), String> {
    let text = text.trim();
    let written = match text.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => format!("1 {text}"),
        false => text.to_owned(),
    };
    match parse_quantity(&written, Dimension::Length) {
        Ok(unit) if unit > 0.0 => Ok((unit, written)),
        Ok(_) => Err(format!(
            "--unit {text}: expected more than 0 mm, such as `mm` or `in`"
        )),
        Err(e) => Err(format!("--unit {text}: {e}")),
    }
}

/// Length and width of a ply (m): `400 x 200 mm`, `400mm x 0.2m`, `400mmx200mm`.
///
/// # Errors
/// Says what was given and what is expected.
pub fn ply(text: &str) -> Result<[f64; 2], String> {
    let wrong = |why: String| {
        format!("--ply {text}: {why}; expected length and width, such as `400 x 200 mm`")
    };
    let parts: Vec<&str> = text.split(['x', 'X', '×', '*']).map(str::trim).collect();
    let [length, width] = parts[..] else {
        return Err(wrong(format!("it has {} sizes", parts.len())));
    };
    // The unit of the second is that of the first, where that has none.
    let bare = |t: &str| !t.contains(|c: char| c.is_alphabetic());
    let unit = width.trim_start_matches(|c: char| c.is_ascii_digit() || "+-. ".contains(c));
    let length = match bare(length) {
        true => format!("{length} {unit}"),
        false => length.to_owned(),
    };
    let one = |text: &str| match parse_quantity(text, Dimension::Length) {
        Ok(value) if value > 0.0 => Ok(value),
        Ok(_) => Err(wrong(format!("`{text}` is not more than 0 mm"))),
        Err(e) => Err(wrong(e.to_string())),
    };
    Ok([one(&length)?, one(width)?])
}

/// A length (m) as a scene writes it: in mm, to the micrometre.
pub fn mm(metres: f64) -> String {
    format!("{} mm", si_number((metres * 1e6).round() / 1e3 + 0.0))
}

/// A text as YAML has it in a mapping in one line.
pub fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
    let begins = |c: char| c.is_ascii_alphabetic() || c == '.' || c == '/';
    match text.starts_with(begins) && text.chars().all(plain) {
        true => text.to_owned(),
        false => serde_json::Value::from(text).to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_as_people_write_them_and_what_is_none_is_told() {
        for text in [
            "400 x 200 mm",
            "400mm x 200mm",
            "400mmx0.2m",
            "40 x 20 cm",
            "0.4 m × 200 mm",
        ] {
            let [length, width] = ply(text).unwrap_or_else(|e| panic!("{e}"));
            assert!(
                (length - 0.4).abs() < 1e-15 && (width - 0.2).abs() < 1e-15,
                "{text}"
            );
        }
        for (text, says) in [
            ("400 mm", "it has 1 sizes"),
            ("400 x 200 x 3 mm", "it has 3 sizes"),
            ("400 x 200", "such as `400 x 200 mm`"),
            ("0 x 200 mm", "not more than 0"),
            ("400 kg x 200 mm", "400 kg"),
        ] {
            let told = ply(text).unwrap_err();
            assert!(told.contains(says) && told.contains("expected"), "{told}");
        }
    }

    #[test]
    fn a_unit_is_a_word_or_a_length() {
        assert_eq!(unit("mm").unwrap(), (1e-3, "1 mm".to_owned()));
        assert_eq!(unit(" 0.1 mm").unwrap(), (1e-4, "0.1 mm".to_owned()));
        assert!(unit("in").unwrap().0 == 0.0254);
        for wrong in ["kg", "-1 mm", "", "inchs"] {
            assert!(unit(wrong).unwrap_err().contains("--unit"), "{wrong}");
        }
    }

    #[test]
    fn texts_that_yaml_would_read_otherwise_are_quoted() {
        assert_eq!(quoted("../tools/hat.stl"), "../tools/hat.stl");
        assert_eq!(quoted("my tool.stl"), "\"my tool.stl\"");
        assert_eq!(quoted("1e3"), "\"1e3\"");
        assert_eq!(quoted("a: b"), "\"a: b\"");
    }
}
