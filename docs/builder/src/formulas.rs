//! Formulas: `$...$` and `$$...$$` become MathML, which browsers draw by themselves.

use anyhow::{Result, bail};
use mdbook_preprocessor::book::{Book, BookItem};
use mdbook_preprocessor::{Preprocessor, PreprocessorContext};
use pulldown_cmark::{Event, Tag, TagEnd};
use pulldown_latex::config::{DisplayMode, RenderConfig};
use pulldown_latex::{Parser, Storage, push_mathml};

use crate::markdown;

const ALONE: &str = "a dollar sign without its partner: close the formula and its braces, or write \\$ or a span of code";

/// The preprocessor. It fails with file and line of every formula that does not parse, and of every dollar sign that stands alone.
pub struct Formulas;

impl Preprocessor for Formulas {
    fn name(&self) -> &str {
        "formulas"
    }

    fn run(
        &self,
        _: &PreprocessorContext,
        mut book: Book,
    ) -> mdbook_preprocessor::errors::Result<Book> {
        let mut findings = Vec::new();
        book.for_each_mut(|item| {
            let BookItem::Chapter(chapter) = item else {
                return;
            };
            match with_mathml(&chapter.content) {
                Ok(content) => chapter.content = content,
                Err(found) => {
                    let file = chapter.source_path.clone().unwrap_or_default();
                    findings.extend(
                        found
                            .into_iter()
                            .map(|(line, what)| format!("{}:{line}: {what}", file.display())),
                    );
                }
            }
        });
        if findings.is_empty() {
            Ok(book)
        } else {
            bail!("formulas:\n{}", findings.join("\n"))
        }
    }
}

/// A page with MathML in the place of its formulas, or the line and the fault of each one that is wrong.
///
/// Code, spans of code and escaped dollar signs stay as they are.
pub fn with_mathml(text: &str) -> Result<String, Vec<(usize, String)>> {
    let mut edits = Vec::new();
    let mut findings = Vec::new();
    let mut in_code = false;
    for (event, range) in markdown::parser(text).into_offset_iter() {
        let (formula, mode) = match &event {
            Event::InlineMath(formula) => (formula, DisplayMode::Inline),
            Event::DisplayMath(formula) => (formula, DisplayMode::Block),
            Event::Start(Tag::CodeBlock(_)) => {
                in_code = true;
                continue;
            }
            Event::End(TagEnd::CodeBlock) => {
                in_code = false;
                continue;
            }
            Event::Text(words) if !in_code && words.contains('$') => {
                let alone = text[range.clone()]
                    .match_indices('$')
                    .map(|(place, _)| range.start + place);
                for place in alone.filter(|place| !text[..*place].ends_with('\\')) {
                    let line = markdown::line(text, place);
                    if findings.last().is_none_or(|(last, _)| *last != line) {
                        findings.push((line, ALONE.to_owned()));
                    }
                }
                continue;
            }
            _ => continue,
        };
        match mathml(formula, mode) {
            Ok(math) => edits.push((range, math)),
            Err(error) => {
                let what = format!(
                    "the formula does not parse: {}\n    {formula}",
                    error.trim().replace('\n', "\n    ")
                );
                findings.push((markdown::line(text, range.start), what));
            }
        }
    }
    if findings.is_empty() {
        Ok(markdown::replace(text, &edits))
    } else {
        Err(findings)
    }
}

/// One formula as MathML that stands in one line and in which Markdown finds nothing to interpret.
fn mathml(formula: &str, display_mode: DisplayMode) -> Result<String, String> {
    let formula = &with_limits(formula);
    let storage = Storage::new();
    let events: Vec<_> = Parser::new(formula, &storage)
        .collect::<Result<_, _>>()
        .map_err(|error| error.to_string())?;
    let config = RenderConfig {
        display_mode,
        ..RenderConfig::default()
    };
    let mut written = String::new();
    let events = events.into_iter().map(Ok::<_, std::convert::Infallible>);
    push_mathml(&mut written, events, config).map_err(|error| error.to_string())?;
    Ok(for_markdown(&written))
}

/// `\operatorname*{word}`, whose star the parser takes for the word, as `\operatorname{word}\limits`.
fn with_limits(formula: &str) -> String {
    let mut parts = formula.split(r"\operatorname*");
    let mut result = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let mut depth = 0;
        let end = part.char_indices().find(|(_, character)| {
            depth += match character {
                '{' => 1,
                '}' => -1,
                _ => 0,
            };
            *character == '}' && depth == 0
        });
        let (word, rest) = part.split_at(end.map_or(0, |(place, _)| place + 1));
        result.push_str(&format!(r"\operatorname{word}\limits{rest}"));
    }
    result
}

/// Markdown reads the text between inline tags, so what it may take for a mark is written by its number. So are signs that the
/// writer of MathML leaves as they are (`<`), and an escaped underscore in a text is an underscore.
fn for_markdown(html: &str) -> String {
    let mut result = String::with_capacity(html.len() + html.len() / 4);
    let mut in_tag = false;
    let mut characters = html.chars().peekable();
    while let Some(character) = characters.next() {
        let next = characters.peek().copied().unwrap_or(' ');
        match character {
            '\n' | '\r' => result.push(' '),
            '<' if !in_tag && (next.is_ascii_alphabetic() || next == '/') => {
                in_tag = true;
                result.push(character);
            }
            '>' if in_tag => {
                in_tag = false;
                result.push(character);
            }
            '\\' if !in_tag && next == '_' => {}
            // Of a character that is written by its name or number already.
            '&' if !in_tag && (next.is_ascii_alphabetic() || next == '#') => {
                result.push(character);
                for part in characters.by_ref() {
                    result.push(part);
                    if part == ';' {
                        break;
                    }
                }
            }
            mark if !in_tag && mark.is_ascii_punctuation() => {
                result.push_str(&format!("&#{};", u32::from(mark)))
            }
            _ => result.push(character),
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(text: &str) -> String {
        with_mathml(text).unwrap_or_else(|found| panic!("{found:?}"))
    }

    #[test]
    fn an_inline_formula_becomes_mathml() {
        let html = page("The angle $\\gamma_1$ is small.");
        assert!(html.starts_with("The angle <math"), "{html}");
        assert!(html.ends_with("</math> is small."), "{html}");
        assert!(html.contains("<msub>"), "{html}");
    }

    #[test]
    fn a_formula_of_its_own_becomes_a_block_in_one_line() {
        let html = page("before\n\n$$ a = \\frac{b}{c},\n\\qquad d^2 $$\n\nafter\n");
        assert!(html.contains("display=\"block\""), "{html}");
        assert_eq!(html.lines().count(), 5, "{html}");
    }

    #[test]
    fn code_is_left_alone() {
        for text in [
            "`$HOME` and `$PATH`",
            "```sh\nexport PATH=\"$PWD:$PATH\"\n```",
            "- a list\n\n  ```sh\n  echo $A $B\n  ```",
            "    indented $x$ code",
            "it costs \\$5",
        ] {
            assert_eq!(page(text), text);
        }
    }

    #[test]
    fn formulas_stand_in_tables_and_lists() {
        let html = page("| a | b |\n|---|---|\n| $x^2$ | `$y` |\n\n- $z$\n");
        assert_eq!(html.matches("<math").count(), 2, "{html}");
    }

    #[test]
    fn markdown_sees_no_marks_in_a_formula() {
        let html = page("$a * b * c [d](e) |f| _g$");
        let inside = html.trim_start_matches(|c| c != '>');
        assert!(
            !inside.contains("<mo>*") && !inside.contains('[') && !inside.contains('|'),
            "{html}"
        );
    }

    #[test]
    fn less_than_is_no_tag() {
        let html = page("$a < b$");
        assert!(html.contains("<mo>&#60;</mo>"), "{html}");
    }

    #[test]
    fn a_formula_that_does_not_parse_is_told_with_its_line() {
        let found = with_mathml("fine $a$\n\n$$ a \\right) $$\n").unwrap_err();
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].0, 3);
        assert!(found[0].1.contains("does not parse"), "{found:?}");
    }

    #[test]
    fn an_unknown_command_is_told() {
        assert!(with_mathml("$\\notacommand x$").is_err());
    }

    #[test]
    fn an_escaped_underscore_in_a_word_is_an_underscore() {
        let html = page("$\\texttt{hourglass\\_floor}$");
        assert!(!html.contains('\\') && html.contains("&#95;"), "{html}");
    }

    #[test]
    fn a_starred_operator_has_its_word_below() {
        let html = page("$\\operatorname*{arg\\,min}_x f$");
        assert!(html.contains("<munder>") && !html.contains('*'), "{html}");
        assert_eq!(
            with_limits(r"a \operatorname*{b{c}d}_x"),
            r"a \operatorname{b{c}d}\limits_x"
        );
    }

    #[test]
    fn a_dollar_sign_alone_is_told_with_its_line() {
        let found = with_mathml("one\ntwo $x is open\n\n$$ \\frac{a $$\n").unwrap_err();
        assert_eq!(
            found.iter().map(|(line, _)| *line).collect::<Vec<_>>(),
            [2, 4]
        );
    }
}
