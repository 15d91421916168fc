//! What all parts of the builder do with the text of a page: parse it as mdBook does, edit it by byte ranges, name its lines.

use std::ops::Range;

use pulldown_cmark::{Options, Parser};

/// A parser with the extensions that mdBook uses, and with formulas.
pub fn parser(text: &str) -> Parser<'_> {
    let options = Options::ENABLE_TABLES
        | Options::ENABLE_FOOTNOTES
        | Options::ENABLE_STRIKETHROUGH
        | Options::ENABLE_TASKLISTS
        | Options::ENABLE_HEADING_ATTRIBUTES
        | Options::ENABLE_DEFINITION_LIST
        | Options::ENABLE_GFM
        | Options::ENABLE_MATH;
    Parser::new_ext(text, options)
}

/// The number of the line, from 1, in which the byte `offset` of a text lies.
pub fn line(text: &str, offset: usize) -> usize {
    text.bytes()
        .take(offset)
        .filter(|byte| *byte == b'\n')
        .count()
        + 1
}

/// The text with new words for some ranges of it. The ranges are in ascending order and do not overlap.
pub fn replace(text: &str, edits: &[(Range<usize>, String)]) -> String {
    let mut result = String::with_capacity(text.len());
    let mut done = 0;
    for (range, words) in edits {
        result.push_str(&text[done..range.start]);
        result.push_str(words);
        done = range.end;
    }
    result.push_str(&text[done..]);
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_from_one() {
        assert_eq!(line("a\nb\n", 0), 1);
        assert_eq!(line("a\nb\n", 2), 2);
    }

    #[test]
    fn ranges_are_replaced_in_order() {
        assert_eq!(
            replace("one two three", &[(0..3, "1".into()), (8..13, "3".into())]),
            "1 two 3"
        );
    }
}
