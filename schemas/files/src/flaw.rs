//! What is wrong with a text, and where in it.

use crate::text::{LONGEST_MESSAGE, decode, excerpt, lines};
use std::ops::Range;

/// Something that is wrong with a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flaw {
    /// Bytes of the text that [`plain`] gives. Empty at 0 where it is the whole file.
    pub span: Range<usize>,
    /// A sentence.
    pub problem: String,
    /// What is expected instead.
    pub expected: Option<String>,
    /// What to do.
    pub help: Option<String>,
}

impl Flaw {
    /// At a place.
    pub fn at(span: Range<usize>, problem: impl Into<String>) -> Self {
        let problem = excerpt(&problem.into(), LONGEST_MESSAGE);
        let (expected, help) = (None, None);
        Self {
            span,
            problem,
            expected,
            help,
        }
    }

    /// Of the whole file.
    pub fn whole(problem: impl Into<String>) -> Self {
        Self::at(0..0, problem)
    }

    /// With what is expected.
    #[must_use]
    pub fn expected(mut self, expected: impl Into<String>) -> Self {
        self.expected = Some(excerpt(&expected.into(), LONGEST_MESSAGE));
        self
    }

    /// With what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(excerpt(&help.into(), LONGEST_MESSAGE));
        self
    }

    /// Line and column in characters, both from 1, in the text that the span is of.
    pub fn place(&self, text: &str) -> (usize, usize) {
        let before = text.get(..self.span.start).unwrap_or(text);
        let line = before.bytes().filter(|b| *b == b'\n').count() + 1;
        let begin = before.rfind('\n').map_or(0, |i| i + 1);
        (line, before[begin..].chars().count() + 1)
    }

    /// `file:line:column: problem; expected ..; help`. `text`: what [`plain`] gives of the file.
    pub fn of(&self, file: &str, text: &str) -> String {
        let (line, column) = self.place(text);
        let mut told = format!("{file}:{line}:{column}: {}", self.problem);
        if let Some(expected) = &self.expected {
            told += &format!("; expected {expected}");
        }
        if let Some(help) = &self.help {
            told += &format!("; {help}");
        }
        told
    }
}

/// The text of a file ([`decode`]) with `\n` at the end of every line, so that places in it can be told by bytes.
///
/// # Errors
/// A sentence on what it is instead of text.
pub fn plain(bytes: &[u8]) -> Result<String, String> {
    let text = decode(bytes)?;
    if !text.contains('\r') {
        return Ok(text.into_owned());
    }
    let mut out = String::with_capacity(text.len());
    for (_, line) in lines(&text) {
        out.push_str(line);
        out.push('\n');
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flaw_is_told_with_its_line_and_column_whatever_ends_the_lines() {
        for bytes in [&b"a\r\nb\xf6c"[..], b"a\rb\xf6c", b"a\nb\xf6c"] {
            let text = plain(bytes).unwrap();
            let at = text.find('c').unwrap();
            let flaw = Flaw::at(at..at + 1, "it is wrong")
                .expected("d")
                .help("mend it");
            let told = flaw.of("f.csv", &text);
            assert_eq!(told, "f.csv:2:3: it is wrong; expected d; mend it");
        }
        assert_eq!(Flaw::whole("x").place(""), (1, 1));
    }
}
