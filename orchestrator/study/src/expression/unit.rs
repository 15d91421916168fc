//! Where the unit of a number ends.

use super::tree::{FUNCTIONS, Names, WORDS};
use plyflow_model::units::parse_unit;

fn is_letter(c: char) -> bool {
    c.is_alphabetic() || ['°', '%', 'µ', '"'].contains(&c)
}

/// Bytes of one factor of a unit at the start of a text; 0 where there is none.
fn factor(text: &str) -> usize {
    let power = |c: char| c.is_ascii_digit() || "^⁰¹²³⁴⁵⁶⁷⁸⁹⁻".contains(c);
    let letters = text.find(|c| !is_letter(c)).unwrap_or(text.len());
    if letters == 0 || text.starts_with('"') {
        return 0;
    }
    let rest = &text[letters..];
    // `m-2 m` is a difference here, so that a negative power needs its sign: `m^-2`.
    let minus = usize::from(rest.starts_with("^-")) * 2;
    let body = &rest[minus..];
    let raised = body.find(|c| !power(c)).unwrap_or(body.len());
    letters + if raised == 0 { 0 } else { minus + raised }
}

/// Bytes of the first factor of a unit, perhaps below a stroke; 0 where there is none.
fn first(body: &str, blanks: usize) -> usize {
    let over = ["1/", "/"].into_iter().find(|s| body.starts_with(s));
    let over = over
        .filter(|s| body[s.len()..].starts_with(is_letter) && (*s == "1/" || blanks == 0))
        .map(|sign| sign.len() + factor(&body[sign.len()..]));
    let end = over.unwrap_or_else(|| factor(body));
    let word = body[..end].trim_start_matches(|c: char| !is_letter(c));
    let called =
        || body[end..].trim_start().starts_with('(') && FUNCTIONS.iter().any(|f| f.0 == word);
    match over.is_none() && (WORDS.contains(&word) || called()) {
        true => 0,
        false => end,
    }
}

/// The unit that follows a number, and how many bytes it takes; empty when there is none.
pub(super) fn unit(rest: &str, names: Names<'_>) -> (usize, String) {
    let blanks = rest.len() - rest.trim_start_matches([' ', '\t']).len();
    let body = &rest[blanks..];
    let mut end = first(body, blanks);
    if end == 0 {
        return (0, String::new());
    }
    loop {
        let next = &body[end..];
        if let Some(after) = next.strip_prefix(['/', '*', '·', '.']) {
            let n = factor(after);
            let called = after[n..].starts_with('(');
            if n > 0 && !called {
                end += next.len() - after.len() + n;
                continue;
            }
        }
        let after = next.trim_start_matches(' ');
        let n = factor(after);
        let word = &after[..n];
        if n > 0
            && after.len() < next.len()
            && !WORDS.contains(&word)
            && parse_unit(word).is_ok()
            && !names.all.iter().any(|v| v == word)
        {
            end += next.len() - after.len() + n;
            continue;
        }
        break;
    }
    let unit = match body[..end].strip_prefix('/') {
        Some(below) => format!("1/{below}"),
        None => body[..end].to_owned(),
    };
    (blanks + end, unit)
}

/// The variable that a unit of several factors, or one below a stroke, seems to be meant for: `1/h` is a number per hour or one over a
/// variable `h`, and `1/h2` one over `h2`. Only where names stand alone.
pub(super) fn variable_in<'n>(unit: &str, names: Names<'n>) -> Option<&'n String> {
    let parts = ['/', '*', '·', '.', ' '];
    if !names.bare || !unit.contains(parts) {
        return None;
    }
    let factors = unit.split(parts);
    // With the power and without: `h2` is a name, or the square of `h`.
    let mut words = factors.flat_map(|f| [f, f.trim_end_matches(|c| !is_letter(c))]);
    words.find_map(|word| names.all.iter().find(|n| *n == word))
}
