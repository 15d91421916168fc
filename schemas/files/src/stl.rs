//! STL files: text in its dialects, and binary.
//!
//! Text is read word by word: names after `solid` and `endsolid` mean nothing, whatever their encoding; capitals mean nothing; normals
//! are not used, so that they may be missing or no numbers; lines that begin with `color` and comments (`#`, `;`, `//`, `!`, `%`, `/* */`) are
//! passed over. Anything else that is no STL is refused with its line: a facet is never left out.

use crate::number::{Signs, value};
use crate::text::{decode, excerpt, shown};
use std::borrow::Cow;
use std::path::Path;

/// Corners of a facet.
pub type Corners = [[f64; 3]; 3];

/// The facets of all solids of a file, in its own unit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Facets {
    /// Their corners: finite numbers.
    pub corners: Vec<Corners>,
    /// The line at which each begins; empty for a binary file.
    pub lines: Vec<u32>,
}

/// Why a file is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StlError {
    /// Line of a text; `None` where it is the whole file or a binary one.
    pub line: Option<u32>,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub remedy: &'static str,
}

impl StlError {
    fn whole(problem: impl Into<String>, remedy: &'static str) -> Self {
        Self {
            line: None,
            problem: problem.into(),
            remedy,
        }
    }

    fn at(line: u32, problem: impl Into<String>) -> Self {
        Self {
            line: Some(line),
            problem: problem.into(),
            remedy: "correct the line, or export the file again",
        }
    }

    /// `file:line: problem; remedy`.
    pub fn of(&self, file: &Path) -> String {
        let line = self.line.map_or(String::new(), |l| format!(":{l}"));
        let file = excerpt(&file.display().to_string(), 300);
        format!("{file}{line}: {}; {}", self.problem, self.remedy)
    }
}

impl Facets {
    /// Where a facet stands in the file: `line 12` of a text, `facet 3` of a binary file.
    pub fn place(&self, facet: usize) -> String {
        match self.lines.get(facet) {
            Some(line) => format!("line {line}"),
            None => format!("facet {}", facet + 1),
        }
    }
}

const HEAD: usize = 84;
const FACET: usize = 50;

/// Reads the bytes of a file.
///
/// # Errors
/// When it is neither, is cut off, has other facets than it says, a facet of other than three corners, or a coordinate that is no finite number.
pub fn parse(bytes: &[u8]) -> Result<Facets, StlError> {
    if bytes.is_empty() {
        return Err(StlError::whole("it is empty", "export the surface again"));
    }
    // Its length alone tells a binary file: many begin with `solid` too.
    if let Some(count) = announced(bytes)
        && bytes.len() as u64 == HEAD as u64 + FACET as u64 * count
    {
        return binary(bytes);
    }
    if let Some(what) = other(bytes) {
        let problem = format!("it is {what}, no STL file");
        return Err(StlError::whole(problem, "export the surface as STL"));
    }
    match as_text(bytes) {
        Some(text) => Text::new(&text).solids(),
        None if bytes[..bytes.len().min(1024)].iter().all(is_written) => Err(StlError::whole(
            "it is text with neither `solid` nor `facet` in it, no STL file",
            "export the surface as STL",
        )),
        None => Err(no_binary(bytes)),
    }
}

/// Number of facets of a binary file.
fn announced(bytes: &[u8]) -> Option<u64> {
    let count: [u8; 4] = bytes.get(80..HEAD)?.try_into().ok()?;
    Some(u32::from_le_bytes(count).into())
}

fn binary(bytes: &[u8]) -> Result<Facets, StlError> {
    let mut corners = Vec::with_capacity((bytes.len() - HEAD) / FACET);
    for (k, facet) in bytes[HEAD..].chunks_exact(FACET).enumerate() {
        let number = |i: usize| {
            let at = 12 + 4 * i;
            let four: [u8; 4] = [0, 1, 2, 3].map(|b| facet[at + b]);
            f64::from(f32::from_le_bytes(four))
        };
        let read: Corners = [0, 3, 6].map(|c| [0, 1, 2].map(|d| number(c + d)));
        if read.iter().flatten().any(|v| !v.is_finite()) {
            return Err(StlError::whole(
                format!(
                    "facet {} has a coordinate that is not a finite number",
                    k + 1
                ),
                "export the file again",
            ));
        }
        corners.push(read);
    }
    if corners.is_empty() {
        return Err(no_facets());
    }
    Ok(Facets {
        corners,
        lines: Vec::new(),
    })
}

fn no_facets() -> StlError {
    StlError::whole("it has no facets", "export the surface as facets")
}

/// Why a file is no binary one.
fn no_binary(bytes: &[u8]) -> StlError {
    let Some(count) = announced(bytes) else {
        return StlError::whole(
            format!(
                "it is no STL file: of {} bytes, neither text nor long enough for binary facets",
                bytes.len()
            ),
            "export the surface as STL",
        );
    };
    let there = (bytes.len() - HEAD) / FACET;
    if (there as u64) < count {
        return StlError::whole(
            format!("it ends after {there} of the {count} facets that it announces"),
            "it was cut off, or is no STL file: copy or export it again",
        );
    }
    let more = bytes.len() as u64 - HEAD as u64 - FACET as u64 * count;
    StlError::whole(
        format!(
            "it announces {count} facets, and goes on for {more} bytes behind the last of them"
        ),
        "export it again: facets beyond the number that it announces are lost, or it was damaged",
    )
}

/// Whether a byte stands in texts.
fn is_written(b: &u8) -> bool {
    matches!(b, 9..=13 | 32..)
}

/// What a file is instead, by how it begins.
fn other(bytes: &[u8]) -> Option<&'static str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = bytes.trim_ascii_start();
    let starts = |s: &str| {
        text.get(..s.len())
            .is_some_and(|t| t.eq_ignore_ascii_case(s.as_bytes()))
    };
    for (start, what) in [
        ("ISO-10303", "a STEP file"),
        ("<", "HTML or XML"),
        ("PK\u{3}\u{4}", "a zip archive (as 3MF is one)"),
        ("ply\n", "a PLY file"),
        ("ply\r", "a PLY file"),
        ("OFF\n", "an OFF file"),
        ("OFF\r", "an OFF file"),
        ("#VRML", "a VRML file"),
        ("glTF", "a glTF file"),
        ("%PDF", "a PDF file"),
        ("DBRep_DrawableShape", "a BREP file"),
        ("mtllib ", "an OBJ file"),
        ("v ", "an OBJ file"),
        ("$MeshFormat", "a Gmsh file"),
        (
            "version https://git-lfs",
            "the pointer of a file that Git LFS keeps elsewhere",
        ),
    ] {
        if starts(start) {
            return Some(what);
        }
    }
    let gzip = bytes.starts_with(&[0x1f, 0x8b]);
    gzip.then_some("a compressed file")
}

/// The file's words, where it is text. Bytes beyond ASCII stand in names alone, so that most encodings need no reading.
fn as_text(bytes: &[u8]) -> Option<Cow<'_, [u8]>> {
    let end = bytes.iter().rposition(|b| !matches!(b, 0 | 0x1a))?;
    let plain = &bytes[..=end];
    let text: Cow<'_, [u8]> = if plain.contains(&0) {
        // With zeros it is UTF-16, or binary.
        match decode(bytes) {
            Ok(text) => Cow::Owned(text.into_owned().into_bytes()),
            Err(_) => return None,
        }
    } else {
        Cow::Borrowed(plain.strip_prefix(b"\xef\xbb\xbf").unwrap_or(plain))
    };
    let has = |word: &[u8]| {
        text.windows(word.len())
            .any(|w| w.eq_ignore_ascii_case(word))
    };
    (has(b"solid") || has(b"facet")).then_some(text)
}

/// Words that have a meaning.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Key {
    Solid,
    EndSolid,
    Facet,
    EndFacet,
    Loop,
    EndLoop,
    Vertex,
    Colour,
}

/// A word with its line.
#[derive(Debug, Clone, Copy)]
struct Word<'t> {
    text: &'t [u8],
    line: u32,
}

/// Reads text word by word.
#[derive(Clone)]
struct Text<'t> {
    text: &'t [u8],
    at: usize,
    line: u32,
    signs: Signs,
}

impl<'t> Text<'t> {
    fn new(text: &'t [u8]) -> Self {
        Text {
            text,
            at: 0,
            line: 1,
            signs: Signs::default(),
        }
    }

    fn rest(&self) -> &'t [u8] {
        &self.text[self.at..]
    }

    /// Goes on by some bytes.
    fn skip(&mut self, bytes: usize) {
        let to = (self.at + bytes).min(self.text.len());
        for k in self.at..to {
            let newline = match self.text[k] {
                b'\n' => true,
                b'\r' => self.text.get(k + 1) != Some(&b'\n'),
                _ => false,
            };
            self.line += u32::from(newline);
        }
        self.at = to;
    }

    /// Bytes up to the end of the line.
    fn in_line(&self) -> usize {
        let rest = self.rest();
        let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r'));
        end.unwrap_or(rest.len())
    }

    /// The next word that is no comment.
    fn word(&mut self) -> Option<Word<'t>> {
        loop {
            let rest = self.rest();
            let blank = |b: &u8| b.is_ascii_whitespace() || *b == 0x0b;
            let start = rest.iter().position(|b| !blank(b))?;
            self.skip(start);
            let rest = self.rest();
            if rest.starts_with(b"/*") {
                let end = rest.windows(2).position(|w| w == b"*/");
                self.skip(end.map_or(rest.len(), |e| e + 2));
            } else if matches!(rest[0], b'#' | b';' | b'!' | b'%') || rest.starts_with(b"//") {
                self.skip(self.in_line());
            } else {
                let end = rest.iter().position(blank).unwrap_or(rest.len());
                let line = self.line;
                self.at += end;
                let text = &rest[..end];
                return Some(Word { text, line });
            }
        }
    }

    /// What a word means, with the one behind it where both are one (`end loop`, `outer loop`).
    fn key(&mut self, word: Word<'_>) -> Option<Key> {
        let is = |w: &[u8], s: &str| w.eq_ignore_ascii_case(s.as_bytes());
        let keys = [
            ("solid", Key::Solid),
            ("endsolid", Key::EndSolid),
            ("facet", Key::Facet),
            ("endfacet", Key::EndFacet),
            ("loop", Key::Loop),
            ("outerloop", Key::Loop),
            ("endloop", Key::EndLoop),
            ("vertex", Key::Vertex),
            ("color", Key::Colour),
            ("colour", Key::Colour),
        ];
        let known = |w: &[u8]| keys.iter().find(|k| is(w, k.0)).map(|k| k.1);
        if let Some(key) = known(word.text) {
            return Some(key);
        }
        let two = is(word.text, "end") || is(word.text, "outer");
        if !two {
            return None;
        }
        let before = (self.at, self.line);
        let second = self.word()?;
        let joined = [word.text, second.text].concat();
        let key = known(&joined);
        if key.is_none() {
            (self.at, self.line) = before;
        }
        key
    }

    /// Passes over a name: to the end of the line, or to the first facet in it. Returns whether there was one.
    fn name(&mut self) -> bool {
        let rest = self.rest();
        let ends = |b: u8| matches!(b, b'\n' | b'\r');
        let blank = |b: u8| b.is_ascii_whitespace() && !ends(b);
        let facet = |k: usize| {
            let word = rest[k..]
                .get(..6)
                .is_some_and(|w| w[..5].eq_ignore_ascii_case(b"facet") && blank(w[5]));
            word && k > 0 && blank(rest[k - 1]) && {
                let after = rest[k + 5..].iter().take_while(|b| blank(**b)).count();
                let after = rest.get(k + 5 + after..k + 11 + after);
                after.is_some_and(|w| w.eq_ignore_ascii_case(b"normal"))
            }
        };
        // No further than needed: a file may be one line of many solids.
        let end = (0..rest.len()).find(|k| ends(rest[*k]) || facet(*k));
        self.skip(end.unwrap_or(rest.len()));
        end.is_some_and(|k| !ends(rest[k]))
    }

    fn solids(mut self) -> Result<Facets, StlError> {
        let mut facets = Facets::default();
        let mut open = false;
        while let Some(word) = self.word() {
            match self.key(word) {
                Some(Key::Solid) => {
                    self.name();
                    open = true;
                }
                Some(Key::EndSolid) if open => {
                    // On one line with the next solid, whose name is part of this one's then.
                    open = self.name();
                }
                Some(Key::Colour) => self.skip(self.in_line()),
                Some(Key::Facet) if open => {
                    let corners = self.facet(word.line)?;
                    facets.corners.push(corners);
                    facets.lines.push(word.line);
                }
                _ => {
                    let expected = if open {
                        "`facet` or `endsolid`"
                    } else {
                        "`solid`"
                    };
                    let problem = format!("expected {expected}, found `{}`", show(word.text));
                    return Err(StlError::at(word.line, problem));
                }
            }
        }
        if open {
            return Err(StlError {
                remedy: "it was cut off: copy or export it again",
                ..StlError::at(
                    self.line,
                    format!(
                        "it ends without `endsolid`, after {} facets",
                        facets.corners.len()
                    ),
                )
            });
        }
        if let Err((line, problem)) = self.signs.decide() {
            // Three digits behind a comma are a fraction here: nobody writes thousands so.
            if self.signs.point.is_some() {
                return Err(StlError::at(line as u32, problem));
            }
        }
        match facets.corners.is_empty() {
            true => Err(no_facets()),
            false => Ok(facets),
        }
    }

    /// A facet, whose first word was read at `line`.
    fn facet(&mut self, line: u32) -> Result<Corners, StlError> {
        let (mut corners, mut loops, mut words) = ([[0.0; 3]; 3], 0, 0);
        let mut found = 0;
        loop {
            let Some(word) = self.word() else {
                return Err(StlError {
                    remedy: "it was cut off: copy or export it again",
                    ..StlError::at(line, "the file ends within this facet")
                });
            };
            let key = self.key(word);
            match key {
                Some(Key::Loop) if found == 0 && loops == 0 => loops = 1,
                Some(Key::Vertex) if loops < 2 => {
                    let corner = self.corner(word.line)?;
                    if let Some(place) = corners.get_mut(found) {
                        *place = corner;
                    }
                    found += 1;
                }
                Some(Key::EndLoop) if loops == 1 => loops = 2,
                Some(Key::EndFacet) if found == 3 && loops != 1 => return Ok(corners),
                Some(Key::EndFacet) => {
                    let problem = match found {
                        3 => "this facet ends without `endloop`".to_owned(),
                        n => format!("this facet has {n} corners; expected three"),
                    };
                    return Err(StlError::at(line, problem));
                }
                Some(Key::Colour) => self.skip(self.in_line()),
                // `normal` and its numbers, of which no use is made.
                None if found == 0 && loops == 0 && words < 8 => words += 1,
                _ => {
                    let problem = format!(
                        "expected the three corners of a facet and `endfacet`, found `{}`",
                        show(word.text)
                    );
                    return Err(StlError::at(word.line, problem));
                }
            }
        }
    }

    /// The three numbers behind `vertex`, in this line or the next ones.
    fn corner(&mut self, line: u32) -> Result<[f64; 3], StlError> {
        let mut words: Vec<&[u8]> = Vec::with_capacity(3);
        loop {
            let before = (self.at, self.line);
            let Some(word) = self.word() else { break };
            let name = word.text[0].is_ascii_alphabetic() && !no_number(word.text);
            if name || words.len() == 9 {
                (self.at, self.line) = before;
                break;
            }
            words.push(word.text);
        }
        let parts = parts(&words);
        let refused = |problem: String| StlError::at(line, problem);
        let [x, y, z] = parts[..] else {
            return Err(refused(format!(
                "a corner has three numbers; found `{}`",
                show(&words.join(&b' '))
            )));
        };
        let mut corner = [0.0; 3];
        for (text, into) in [x, y, z].into_iter().zip(&mut corner) {
            let sign = match text.contains(',') {
                true => crate::number::Decimal::Comma,
                false => crate::number::Decimal::Point,
            };
            if sign == crate::number::Decimal::Comma || self.signs.point.is_none() {
                self.signs.note(line as usize, text);
            }
            *into = value(text, sign).ok_or_else(|| {
                let what = match no_number(text.as_bytes()) {
                    true => "a coordinate is not a finite number",
                    false => "a coordinate is no number",
                };
                refused(format!("{what}: `{}`", shown(text)))
            })?;
        }
        Ok(corner)
    }
}

/// The numbers of a corner: words, or what commas or semicolons part.
fn parts<'t>(words: &[&'t [u8]]) -> Vec<&'t str> {
    let text = |w: &'t [u8]| std::str::from_utf8(w).unwrap_or("?");
    if let [one] = words {
        let sign = if one.contains(&b';') { ';' } else { ',' };
        return text(one).split(sign).collect();
    }
    words
        .iter()
        .map(|w| text(w).trim_matches([',', ';']))
        .filter(|w| !w.is_empty())
        .collect()
}

/// What programs print for a number that is none.
fn no_number(text: &[u8]) -> bool {
    let text = text.to_ascii_lowercase();
    let text = text.strip_prefix(b"-").unwrap_or(&text);
    text.starts_with(b"nan") || text.starts_with(b"inf") || text.windows(2).any(|w| w == b".#")
}

fn show(text: &[u8]) -> String {
    shown(&String::from_utf8_lossy(
        &text[..text.len().min(4 * crate::text::LONGEST_WORD)],
    ))
}

/// The bytes of a binary file, in single precision.
pub fn write(corners: &[Corners]) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((corners.len() as u32).to_le_bytes());
    for facet in corners {
        bytes.extend([0; 12]);
        let numbers = facet.iter().flatten();
        bytes.extend(numbers.flat_map(|v| (*v as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}
