//! Text of others on its way to a terminal: names, values, logs, messages. The one place that decides what is harmless.
//!
//! A terminal obeys what stands between letters: control characters (they move the cursor, recolour, rename the window,
//! on some terminals type commands) and marks that turn the direction of writing, so that a text reads otherwise than it
//! is. Everything that prints goes through [`safe`]; nothing else has to think of it.

use std::borrow::Cow;

/// What [`is_word`] asks for, for messages.
pub const WORD: &str = "letters, digits, `_` and `-`, none of them `-` at the front, at most 64";

/// Whether a text can be a name in artifacts, labels and file names: letters, digits, `_` and `-`, at most 64.
pub fn is_word(name: &str) -> bool {
    !name.is_empty()
        && name.len() <= 64
        && name.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '_')
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

/// Whether a terminal could take this character for more than a letter. Line ends and tabs are allowed.
#[must_use]
pub fn steers(c: char) -> bool {
    match c {
        '\n' | '\t' => false,
        // C0 with escape and carriage return, delete, C1 with the one-character escape sequences.
        '\0'..='\u{1f}' | '\u{7f}'..='\u{9f}' => true,
        // Marks of direction, and ends of lines that not every program takes for such.
        '\u{200e}'
        | '\u{200f}'
        | '\u{061c}'
        | '\u{2028}'..='\u{202e}'
        | '\u{2066}'..='\u{2069}' => true,
        _ => false,
    }
}

/// The text with everything that could steer a terminal written out, as `\u001b`. JSON stays JSON of the same meaning.
#[must_use]
pub fn safe(text: &str) -> Cow<'_, str> {
    replaced(text, steers)
}

/// As [`safe`], with line ends and tabs too: for a name within a line.
#[must_use]
pub fn one_line(text: &str) -> Cow<'_, str> {
    replaced(text, |c| steers(c) || c == '\n' || c == '\t')
}

/// A text of at most about `most` characters: of a longer one the beginning and the end, with what is left out between them.
#[must_use]
pub fn shortened(text: &str, most: usize) -> Cow<'_, str> {
    // Bytes are at least as many as characters: short texts need no count.
    if text.len() <= most {
        return Cow::Borrowed(text);
    }
    let count = text.chars().count();
    if count <= most {
        return Cow::Borrowed(text);
    }
    let (head, tail) = (most * 2 / 3, (most / 3).max(1));
    let to = text.char_indices().nth(head).map_or(0, |c| c.0);
    let from = text.char_indices().rev().nth(tail - 1).map_or(0, |c| c.0);
    let left = count - head - tail;
    Cow::Owned(format!(
        "{} .. ({left} characters left out) .. {}",
        &text[..to],
        &text[from..]
    ))
}

fn replaced(text: &str, wrong: impl Fn(char) -> bool) -> Cow<'_, str> {
    // Programs write mostly plain text: one look, no copy.
    if !text.chars().any(&wrong) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match (wrong(c), c) {
            (false, c) => out.push(c),
            (true, '\n') => out.push_str("\\n"),
            (true, '\t') => out.push_str("\\t"),
            (true, c) => out.push_str(&format!("\\u{:04x}", u32::from(c))),
        }
    }
    Cow::Owned(out)
}

/// The text with everything that could steer a terminal replaced by as many bytes, so that places in it stay where they are.
#[must_use]
pub fn safe_in_place(text: &str) -> Cow<'_, str> {
    if !text.chars().any(steers) {
        return Cow::Borrowed(text);
    }
    let stand_in = |c: char| match (steers(c), c.len_utf8()) {
        (false, _) => c,
        (true, 1) => '?',
        (true, 2) => '\u{b7}',
        // All others that steer have three bytes.
        (true, _) => '\u{fffd}',
    };
    Cow::Owned(text.chars().map(stand_in).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_character_that_steers_is_left_and_letters_of_any_language_are() {
        let plain = "Träger 1, 面外, µm, \"a\\b\"\n\tnext";
        assert_eq!(safe(plain), plain);
        let all: String = ('\0'..='\u{ffff}').collect();
        for text in [safe(&all), one_line(&all), safe_in_place(&all)] {
            assert!(!text.chars().any(steers));
        }
        assert!(!one_line(&all).contains(['\n', '\t']));
        assert_eq!(
            safe("\x1b[31m\u{9b}2J\r\u{202e}"),
            "\\u001b[31m\\u009b2J\\u000d\\u202e"
        );
        assert_eq!(one_line("a\nb"), "a\\nb");
    }

    #[test]
    fn a_long_text_is_told_by_its_beginning_and_its_end() {
        assert_eq!(shortened("\u{f6}\u{f6}\u{f6}", 3), "\u{f6}\u{f6}\u{f6}");
        let long = format!("begin{}end", "\u{f6}".repeat(1_000_000));
        let short = shortened(&long, 90);
        assert!(short.starts_with("begin\u{f6}") && short.ends_with("\u{f6}end"));
        assert!(short.contains("(999918 characters left out)"), "{short}");
        assert!(short.chars().count() < 130);
    }

    #[test]
    fn json_means_the_same_after_it_was_made_safe() {
        let value = serde_json::json!({"a\u{7f}": "\u{1b}]0;x\u{7}\u{9b}\u{202e}\n"});
        let text = value.to_string();
        let printed = safe(&text);
        assert!(!printed.chars().any(steers));
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&printed).unwrap(),
            value
        );
    }

    #[test]
    fn places_stay_where_they_are_when_a_text_is_made_safe_in_place() {
        let text = "a\u{1b}b\u{9b}c\u{202e}d";
        let made = safe_in_place(text);
        assert_eq!(made.len(), text.len());
        assert_eq!(made.find('d'), text.find('d'));
    }
}
