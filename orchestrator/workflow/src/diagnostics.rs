//! Errors with their place: collected in one pass, shown as text with source lines, or as JSON.

use crate::yaml::{Node, Span};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::text::{LONGEST_MESSAGE, excerpt};
use plyflow_model::text::{one_line, safe, safe_in_place};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The workflow cannot run.
    Error,
    /// It can, but probably means something else.
    Warning,
}

/// One finding.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnostic {
    /// File, as the user named it or as the workflow names it.
    pub file: Utf8PathBuf,
    /// Line, from 1; 0 when the file could not be read.
    pub line: usize,
    /// Column in characters, from 1; 0 when the file could not be read.
    pub column: usize,
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong.
    pub message: String,
    /// What was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given: Option<String>,
    /// What was expected.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<String>,
    /// What to do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
    /// Points of the study at which it was found; empty: it does not depend on them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<String>,
    /// Further places at which the same is missing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<Further>,
    #[serde(skip)]
    pub(crate) span: Span,
    #[serde(skip)]
    text: Option<Arc<String>>,
    /// The step that was being resolved.
    #[serde(skip)]
    pub(crate) step: Option<Arc<str>>,
    /// Whether it is about a thing outside of the file, and so is said once, wherever the file names the thing.
    #[serde(skip)]
    pub(crate) once: bool,
    /// Folders that were searched, and what is there.
    #[serde(skip)]
    pub(crate) searched: Option<[String; 2]>,
}

/// A further place of a finding, in the same file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Further {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The step that it belongs to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<String>,
}

/// All findings of a pass, by file and place.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Diagnostics {
    /// The findings.
    pub items: Vec<Diagnostic>,
}

impl std::error::Error for Diagnostics {}

impl fmt::Display for Diagnostics {
    /// One line each: `file:line:column: message; expected ..; help`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, d) in self.items.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{}:{}:{}: {}", d.file, d.line, d.column, d.message)?;
            if let Some(expected) = &d.expected {
                write!(f, "; expected {expected}")?;
            }
            if let Some(help) = &d.help {
                write!(f, "; {help}")?;
            }
        }
        Ok(())
    }
}

impl Diagnostics {
    /// Whether any finding is an error.
    pub fn has_errors(&self) -> bool {
        self.items.iter().any(|d| d.severity == Severity::Error)
    }

    /// `[{file, line, column, severity, message, given, expected, help, points, also}]`.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::to_value(&self.items).unwrap_or_default()
    }

    /// Text for people: each finding with its source line, a caret and a remedy, then a count.
    ///
    /// The colours are escape sequences of a terminal; the findings' own text holds none.
    pub fn render(&self, colour: bool) -> String {
        let theme = if colour {
            miette::GraphicalTheme::unicode()
        } else {
            miette::GraphicalTheme::unicode_nocolor()
        };
        let handler = miette::GraphicalReportHandler::new_themed(theme)
            .with_width(110)
            .with_context_lines(1);
        let mut out = String::new();
        let items: Vec<Diagnostic> = self.items.iter().map(Diagnostic::made_safe).collect();
        for d in &items {
            if handler.render_report(&mut out, &Report::of(d)).is_err() {
                out += &format!("{}:{}:{}: {}\n", d.file, d.line, d.column, d.message);
            }
        }
        let count = |severity, word: &str| {
            let n = self.items.iter().filter(|d| d.severity == severity).count();
            (n > 0).then(|| format!("{n} {word}{}", if n == 1 { "" } else { "s" }))
        };
        let counts: Vec<String> = [
            count(Severity::Error, "error"),
            count(Severity::Warning, "warning"),
        ]
        .into_iter()
        .flatten()
        .collect();
        if !counts.is_empty() {
            out += &format!("\n{}\n", counts.join(", "));
        }
        out
    }
}

/// Longest line that is shown (bytes). Files that programs write may be one line of any length; nobody finds a caret in
/// such a line, and miette panics when one stands further right than 65535.
const LONGEST_LINE: usize = 2000;

/// Whether the lines of a place, and those around them, which are shown too, are short enough to be shown with a caret.
fn shows_well(text: &str, span: &Span) -> bool {
    let bytes = text.as_bytes();
    let (start, end) = (span.start.min(bytes.len()), span.end.min(bytes.len()));
    let before = |at: usize| bytes[..at].iter().rposition(|b| *b == b'\n');
    let after = |at: usize| bytes[at..].iter().position(|b| *b == b'\n').map(|i| at + i);
    let first = before(start);
    let above = first.and_then(before);
    let last = after(end);
    let below = last.and_then(|at| after(at + 1));
    let from = first.map_or(0, |i| i + 1);
    let (to, length) = (last.unwrap_or(bytes.len()), bytes.len());
    to - from <= LONGEST_LINE
        && first.is_none_or(|i| i - above.map_or(0, |a| a + 1) <= LONGEST_LINE)
        && last.is_none_or(|i| below.unwrap_or(length) - i <= LONGEST_LINE)
}

/// A finding as miette wants it.
#[derive(Debug)]
struct Report<'a> {
    finding: &'a Diagnostic,
    source: Option<miette::NamedSource<Arc<String>>>,
}

impl<'a> Report<'a> {
    fn of(finding: &'a Diagnostic) -> Self {
        let source = finding
            .text
            .clone()
            .filter(|text| shows_well(text, &finding.span))
            .map(|text| miette::NamedSource::new(finding.file.as_str(), text));
        Report { finding, source }
    }
}

impl std::error::Error for Report<'_> {}

impl fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let d = self.finding;
        match (&self.source, d.line) {
            (Some(_), _) => f.write_str(&d.message),
            (None, 0) => write!(f, "{}: {}", d.file, d.message),
            (None, line) => {
                write!(f, "{}:{line}:{}: {}", d.file, d.column, d.message)?;
                // Elsewhere this stands at the caret.
                let expected = d.expected.as_ref();
                expected.map_or(Ok(()), |e| write!(f, "; expected {e}"))
            }
        }
    }
}

impl miette::Diagnostic for Report<'_> {
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.finding.severity {
            Severity::Error => miette::Severity::Error,
            Severity::Warning => miette::Severity::Warning,
        })
    }

    fn help<'b>(&'b self) -> Option<Box<dyn fmt::Display + 'b>> {
        self.finding
            .help
            .as_ref()
            .map(|h| Box::new(h) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        self.source.as_ref().map(|s| s as &dyn miette::SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        self.source.as_ref()?;
        let label = match &self.finding.expected {
            Some(expected) => format!("expected {expected}"),
            None => "here".into(),
        };
        let span = self.finding.span.clone();
        Some(Box::new(std::iter::once(miette::LabeledSpan::new(
            Some(label),
            span.start,
            span.len().max(1),
        ))))
    }
}

/// A file that findings point into.
#[derive(Debug, Clone)]
pub struct Source {
    /// Name for messages.
    pub name: Utf8PathBuf,
    /// Folder that relative paths in it start from, absolute.
    pub folder: Utf8PathBuf,
    /// Its text.
    pub text: Arc<String>,
    /// What the command line and other files put into its tree. Places in these texts are counted on beyond the file's own, each text
    /// from its `start`, so that a node of the tree knows by its span alone where it comes from.
    pub set: Vec<SetText>,
}

/// A text of which parts are put into the tree of a file: one of the command line (`STEP.PARAMETER=VALUE`), or that of another file.
#[derive(Debug, Clone)]
pub struct SetText {
    /// Place of its first byte, beyond the end of the file.
    pub start: usize,
    /// As given.
    pub text: Arc<String>,
    /// The file that it is the text of; none: it is of the command line.
    pub name: Option<Utf8PathBuf>,
}

impl Source {
    /// In which line (from 1) a place of the tree stands, in words; with the file, where it comes from another one.
    pub fn line(&self, span: &Span) -> String {
        let (text, name, start) = self.origin(span);
        let line = line_column(&text, span.start.saturating_sub(start)).0;
        match name {
            Some(name) if name != self.name => format!("in line {line} of {name}"),
            Some(_) => format!("in line {line}"),
            None => "in what `--set` gives".to_owned(),
        }
    }

    /// Adds a text of the command line and returns the place of its first byte.
    pub fn add_set(&mut self, text: &str) -> usize {
        let end = |s: &SetText| s.start + s.text.len();
        // One byte apart, so that the end of one text is not the start of the next.
        let start = self.set.last().map_or(self.text.len(), end) + 1;
        self.set.push(SetText {
            start,
            text: Arc::new(text.to_owned()),
            name: None,
        });
        start
    }

    /// Where a place of the tree comes from: the text, its file (none: the command line), and the place of its first byte.
    pub fn origin(&self, span: &Span) -> (Arc<String>, Option<Utf8PathBuf>, usize) {
        match self.set.iter().rev().find(|s| s.start <= span.start) {
            Some(set) => (set.text.clone(), set.name.clone(), set.start),
            None => (self.text.clone(), Some(self.name.clone()), 0),
        }
    }

    /// Adds a text of another file, or finds it, and returns the place of its first byte.
    pub fn add_text(&mut self, text: Arc<String>, name: Option<Utf8PathBuf>) -> usize {
        let same = |s: &&SetText| Arc::ptr_eq(&s.text, &text) && s.name == name;
        if let Some(known) = self.set.iter().find(same) {
            return known.start;
        }
        let end = |s: &SetText| s.start + s.text.len();
        let start = self.set.last().map_or(self.text.len(), end) + 1;
        self.set.push(SetText { start, text, name });
        start
    }
}

/// A text that names something, where it is written.
pub struct Mention<'a> {
    /// The file.
    pub source: &'a Source,
    /// Where in it.
    pub span: &'a Span,
    /// The text.
    pub text: &'a str,
}

impl<'a> Mention<'a> {
    /// Of a text of a file.
    pub fn new(source: &'a Source, span: &'a Span, text: &'a str) -> Self {
        Self { source, span, text }
    }
}

/// Collects findings.
#[derive(Debug, Default)]
pub struct Problems {
    pub(crate) items: Vec<Diagnostic>,
    step: Option<Arc<str>>,
    /// Of each of them its place in the tree, beyond the file's own text where it comes from elsewhere.
    places: Vec<Span>,
    read: BTreeMap<Utf8PathBuf, String>,
    forms: Vec<(Utf8PathBuf, Utf8PathBuf)>,
    parsed: BTreeMap<Utf8PathBuf, (Source, Node)>,
}

impl Problems {
    /// Says of all findings from now on that they belong to a step, or to none.
    pub fn of_step(&mut self, name: Option<&str>) {
        self.step = name.map(Arc::from);
    }

    /// Adds a finding at a place and returns it, to say more about it.
    pub fn add(
        &mut self,
        source: &Source,
        span: &Span,
        message: impl Into<String>,
    ) -> &mut Diagnostic {
        let place = span.clone();
        let set = source.set.iter().rev().find(|s| s.start <= span.start);
        let mut message = shown(message);
        let (file, text, span) = match set {
            None => (source.name.clone(), &source.text, span.clone()),
            Some(SetText {
                start,
                text,
                name: Some(name),
            }) => {
                let span = span.start - start..span.end.max(span.start) - start;
                (name.clone(), text, span)
            }
            Some(set) => {
                message.push_str(&format!(" (given by `--set {}`)", excerpt(&set.text, 200)));
                let span = span.start - set.start..span.end.max(span.start) - set.start;
                ("--set".into(), &set.text, span)
            }
        };
        let (line, column) = line_column(text, span.start);
        self.places.push(place);
        self.push(Diagnostic {
            file,
            line,
            column,
            severity: Severity::Error,
            message,
            given: None,
            expected: None,
            help: None,
            points: Vec::new(),
            also: Vec::new(),
            span,
            text: Some(text.clone()),
            step: None,
            once: false,
            searched: None,
        })
    }

    /// Adds a finding about a file that cannot be read as a whole.
    pub fn add_unreadable(&mut self, file: &Utf8Path, message: String) -> &mut Diagnostic {
        self.places.push(0..0);
        self.push(Diagnostic {
            file: file.to_owned(),
            line: 0,
            column: 0,
            severity: Severity::Error,
            message: shown(message),
            given: None,
            expected: None,
            help: None,
            points: Vec::new(),
            also: Vec::new(),
            span: 0..0,
            text: None,
            step: None,
            once: false,
            searched: None,
        })
    }

    fn push(&mut self, mut d: Diagnostic) -> &mut Diagnostic {
        d.step = self.step.clone();
        let i = self.items.len();
        self.items.push(d);
        &mut self.items[i]
    }

    /// Takes down that a file was read, with the BLAKE3 of what was in it. A file that changed between two
    /// readings in one pass keeps a hash that no content has: what was resolved from it is of no one state.
    pub fn note_file(&mut self, path: &Utf8Path, hash: &str) {
        let known = self
            .read
            .entry(path.to_owned())
            .or_insert_with(|| hash.to_owned());
        if known != hash {
            known.clear();
        }
    }

    /// Takes down that there was no file of a name, and which has the same name in another form of Unicode.
    pub fn note_form(&mut self, name: &Utf8Path, found: &Utf8Path) {
        self.forms.push((name.to_owned(), found.to_owned()));
    }

    /// Names of which there was no file, with the file that was taken for it.
    pub fn forms(&self) -> &[(Utf8PathBuf, Utf8PathBuf)] {
        &self.forms
    }

    /// The files that were read, with their hashes.
    pub fn files(&self) -> &BTreeMap<Utf8PathBuf, String> {
        &self.read
    }

    /// A file that was read and parsed in this pass. It is read once, whoever names it, and at however many points.
    pub fn parsed(&self, path: &Utf8Path) -> Option<(Source, Node)> {
        self.parsed.get(path).cloned()
    }

    /// Keeps a file that was read and parsed.
    pub fn keep_parsed(&mut self, path: &Utf8Path, file: &(Source, Node)) {
        self.parsed.insert(path.to_owned(), file.clone());
    }

    /// Says of all findings behind the first `from` that they are of this point of the study.
    pub fn at_point(&mut self, from: usize, point: &str) {
        for d in &mut self.items[from..] {
            if d.points.is_empty() && !point.is_empty() {
                d.points.push(point.to_owned());
            }
        }
    }

    /// How many so far; to learn whether a part added any.
    pub fn count(&self) -> usize {
        self.items.len()
    }

    /// Where in their trees all findings behind the first `from` lie.
    pub fn places_from(&self, from: usize) -> Vec<Span> {
        self.places[from..].to_vec()
    }
}

impl Diagnostic {
    /// With nothing in it that could steer a terminal.
    fn made_safe(&self) -> Self {
        let made = |text: &Option<String>| text.as_ref().map(|t| safe(t).into_owned());
        let text = self.text.as_ref().map(|t| match safe_in_place(t) {
            std::borrow::Cow::Borrowed(_) => t.clone(),
            std::borrow::Cow::Owned(changed) => Arc::new(changed),
        });
        Self {
            file: one_line(self.file.as_str()).into_owned().into(),
            message: safe(&self.message).into_owned(),
            given: made(&self.given),
            expected: made(&self.expected),
            help: made(&self.help),
            points: self.points.iter().map(|p| safe(p).into_owned()).collect(),
            also: self.also.clone(),
            span: self.span.clone(),
            text,
            step: self.step.clone(),
            searched: None,
            ..*self
        }
    }

    /// States what was given.
    pub fn given(&mut self, text: impl Into<String>) -> &mut Self {
        self.given = Some(shown(text));
        self
    }

    /// States what was expected.
    pub fn expected(&mut self, text: impl Into<String>) -> &mut Self {
        self.expected = Some(shown(text));
        self
    }

    /// States that it is about a thing outside of the file: it is said once, with all steps that name the thing.
    pub fn once(&mut self) -> &mut Self {
        self.once = true;
        self
    }

    /// States which folders were searched, and what is there: the folders are listed once for all findings.
    pub fn searched(&mut self, folders: String, there: String) -> &mut Self {
        self.searched = Some([folders, there].map(shown));
        self
    }

    /// States the remedy.
    pub fn help(&mut self, text: impl Into<String>) -> &mut Self {
        self.help = Some(shown(text));
        self
    }

    /// Suggests the nearest of `names`, or lists them when they are few.
    pub fn suggest<'a>(
        &mut self,
        given: &str,
        names: impl IntoIterator<Item = &'a str>,
    ) -> &mut Self {
        let names: Vec<&str> = names.into_iter().collect();
        if self.expected.is_none() && !names.is_empty() && names.len() <= 12 {
            self.expected = Some(plyflow_model::manifest::one_of(names.iter().copied()));
        }
        if let Some(nearest) = plyflow_model::nearest::nearest(given, names) {
            self.help = Some(shown(format!("did you mean `{nearest}`?")));
        }
        self
    }
}

/// A text as findings have it, whatever of a user's is in it: of bounded length, and without characters that a terminal obeys.
fn shown(text: impl Into<String>) -> String {
    excerpt(&text.into(), LONGEST_MESSAGE)
}

/// Line and column (characters), both from 1.
fn line_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..offset.min(text.len())];
    let start = before.rfind('\n').map_or(0, |i| i + 1);
    (
        before.matches('\n').count() + 1,
        before[start..].chars().count() + 1,
    )
}
