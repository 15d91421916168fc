//! Values by their path in a tree: mappings by key, lists by the names of their entries, scenes and materials also through the files
//! that they are in.

use crate::diagnostics::{Problems, Source};
use crate::yaml::{Entry, Kind, Node, Span};

/// A word of a path and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Word {
    pub name: String,
    pub span: Span,
}

/// Why a path leads nowhere.
pub(crate) struct Blocked {
    /// How many words of the path lead to what stands in the way.
    pub at: usize,
    /// What it is.
    pub what: String,
    /// Of a list: the names of its entries.
    pub names: Vec<String>,
}

impl Blocked {
    fn here(node: &Node, names: Vec<String>) -> Self {
        Self {
            at: 0,
            what: node.describe(),
            names,
        }
    }

    fn further(self) -> Self {
        Self {
            at: self.at + 1,
            ..self
        }
    }

    /// Reports it at the word that leads nowhere, and returns the finding, to say more about it.
    pub fn report<'p>(
        &self,
        path: &[Word],
        source: &Source,
        problems: &'p mut Problems,
    ) -> &'p mut crate::diagnostics::Diagnostic {
        let below = &path[self.at];
        let name = self.at.checked_sub(1).map_or("", |i| path[i].name.as_str());
        let message = match (self.names.is_empty(), name) {
            (false, name) => format!("there is no `{}` in the list `{name}`", below.name),
            (true, "") => format!("there is no `{}` in {} to be set", below.name, self.what),
            (true, name) => format!(
                "`{name}` is {}: there is no `{}` in it to be set",
                self.what, below.name
            ),
        };
        let d = problems.add(source, &below.span, message);
        if !self.names.is_empty() {
            d.suggest(&below.name, self.names.iter().map(String::as_str));
        }
        d
    }
}

/// The words of a path; `first`: the place of its first byte, where it stands as it is.
fn words(text: &str, span: &Span, first: Option<usize>) -> Vec<Word> {
    let mut from = 0;
    let word = |name: &str| {
        let blank = name.len() - name.trim_start().len();
        let start = first.map(|f| f + from + blank);
        from += name.len() + 1;
        let name = name.trim();
        Word {
            name: name.to_owned(),
            span: start.map_or(span.clone(), |s| s..s + name.len()),
        }
    };
    text.split('.').map(word).collect()
}

/// Puts a value where a path leads. What a mapping does not have yet is made in it. `files`: whether `material` may be the path of a file,
/// into which the path then goes on.
pub(crate) fn put(node: &mut Node, path: &[Word], value: Node, files: bool) -> Result<(), Blocked> {
    let Some((word, rest)) = path.split_first() else {
        *node = value;
        return Ok(());
    };
    if node.kind == Kind::Null {
        *node = Node {
            kind: Kind::Map(Vec::new()),
            span: word.span.clone(),
        };
    }
    let below = match &mut node.kind {
        Kind::Map(entries) => below(entries, word),
        Kind::List(items) => {
            let (found, names) = item(items, &word.name);
            match found {
                Some(i) => &mut items[i],
                None => return Err(Blocked::here(node, names)),
            }
        }
        _ => return Err(Blocked::here(node, Vec::new())),
    };
    if files && word.name == "material" && !rest.is_empty() {
        return put_in_file(below, rest, value).map_err(Blocked::further);
    }
    put(below, rest, value, files).map_err(Blocked::further)
}

/// Puts a value where a path leads into a scene or a material that is a file, or stands there itself.
pub(crate) fn put_in_file(node: &mut Node, path: &[Word], value: Node) -> Result<(), Blocked> {
    if let Kind::Text(_) = node.kind {
        let span = node.span.clone();
        let file = std::mem::replace(
            node,
            Node {
                kind: Kind::Null,
                span: span.clone(),
            },
        );
        node.kind = Kind::Map(vec![Entry {
            key: "file".into(),
            key_span: span,
            value: file,
        }]);
    }
    let own = ["file", "set"];
    let direct = own.contains(&path[0].name.as_str()) && path.len() == 1;
    // `with` of a file names parameters, of which a path may lead deeper.
    let parameter = path[0].name == "with" && path.len() <= 2 && node.get("with").is_some();
    if node.get("file").is_none() || direct || parameter {
        return put(node, path, value, true);
    }
    let set = Word {
        name: "set".into(),
        span: path[0].span.clone(),
    };
    let names: Vec<&str> = path.iter().map(|w| w.name.as_str()).collect();
    let key = Word {
        name: names.join("."),
        span: path[0].span.start..path[path.len() - 1].span.end,
    };
    // Behind what is set already, and in place of what lies in it, so that it has the last word.
    if let Some(Kind::Map(entries)) = entry_mut(node, "set").map(|e| &mut e.value.kind) {
        entries.retain(|e| !covers(&names, &parts(&e.key)));
    }
    put(node, &[set, key], value, false)
}

fn entry_mut<'n>(node: &'n mut Node, key: &str) -> Option<&'n mut Entry> {
    match &mut node.kind {
        Kind::Map(entries) => entries.iter_mut().rev().find(|e| e.key == key),
        _ => None,
    }
}

/// The value of a key, made where there is none.
fn below<'n>(entries: &'n mut Vec<Entry>, word: &Word) -> &'n mut Node {
    let at = entries
        .iter()
        .rposition(|e| e.key == word.name)
        .unwrap_or_else(|| {
            entries.push(Entry {
                key: word.name.clone(),
                key_span: word.span.clone(),
                value: Node {
                    kind: Kind::Null,
                    span: word.span.clone(),
                },
            });
            entries.len() - 1
        });
    &mut entries[at].value
}

/// The position of an entry of a list by its `name`, or by its number (from 0) where entries have no names; and what names there are.
fn item(items: &[Node], word: &str) -> (Option<usize>, Vec<String>) {
    let name = |n: &Node| n.get("name").and_then(Node::text).map(str::to_owned);
    let names: Vec<String> = items.iter().filter_map(name).collect();
    if let Some(i) = items.iter().position(|n| name(n).as_deref() == Some(word)) {
        return (Some(i), names);
    }
    let number = word.parse::<usize>().ok();
    match number.filter(|i| names.is_empty() && *i < items.len()) {
        Some(i) => (Some(i), names),
        None if names.is_empty() => (
            None,
            (0..items.len().min(12)).map(|i| i.to_string()).collect(),
        ),
        None => (None, names),
    }
}

/// The words of a path as it is written.
fn parts(path: &str) -> Vec<&str> {
    path.split('.').map(str::trim).collect()
}

/// Whether what lies at a path is within what lies at another one.
fn covers(path: &[&str], other: &[&str]) -> bool {
    other.starts_with(path)
}

/// Reports an entry of `set` that a later one would take away: the places of both cannot be meant.
fn lost(set: &Entry, from: &Source, problems: &mut Problems) -> bool {
    let entries = set.value.entries();
    let before = problems.count();
    for (i, early) in entries.iter().enumerate() {
        let of_early = parts(&early.key);
        let later = entries[i + 1..].iter();
        if let Some(late) = later
            .into_iter()
            .find(|l| covers(&parts(&l.key), &of_early))
        {
            let message = format!("`{}` takes `{}` away again", late.key, early.key);
            let d = problems.add(from, &late.key_span, message);
            d.help("write the longer path behind the shorter one, or leave one of them out");
        }
    }
    problems.count() > before
}

/// Puts the entries of `set`, a mapping from paths to values that stands in `from`, into the tree of a file.
pub(crate) fn apply(
    tree: &mut Node,
    to: &mut Source,
    set: &Entry,
    from: &Source,
    problems: &mut Problems,
) {
    if set.value.kind == Kind::Null {
        return;
    }
    if !matches!(set.value.kind, Kind::Map(_)) {
        let message = format!("`set` is {}", set.value.describe());
        let d = problems.add(from, &set.value.span, message);
        d.expected("a mapping from paths to values, such as `{friction.fabric_fabric: 0.1}`");
        return;
    }
    if lost(set, from, problems) {
        return;
    }
    for entry in set.value.entries() {
        let mut value = entry.value.clone();
        carry(&mut value, from, to);
        let mut at = Node {
            kind: Kind::Null,
            span: entry.key_span.clone(),
        };
        carry(&mut at, from, to);
        let (whole, _, start) = to.origin(&at.span);
        let raw = whole.get(at.span.start - start..);
        // Behind a quotation mark perhaps.
        let first = raw.and_then(|raw| {
            raw.get(..entry.key.len() + 1)
                .or(Some(raw))?
                .find(&entry.key)
        });
        let path = words(&entry.key, &at.span, first.map(|i| at.span.start + i));
        if let Some(empty) = path.iter().find(|w| w.name.is_empty()) {
            let d = problems.add(to, &empty.span, format!("`{}` is no path", entry.key));
            d.expected("names with points between them, such as `sheets.ply_2.fibre_1`");
            continue;
        }
        if let Err(blocked) = put(tree, &path, value, true) {
            blocked.report(&path, to, problems);
        }
    }
}

/// Moves the places of a tree that stands in one file to where another counts them on.
fn carry(node: &mut Node, from: &Source, to: &mut Source) {
    let mut moved = |span: &Span| {
        let (text, name, start) = from.origin(span);
        let base = to.add_text(text, name);
        span.start - start + base..span.end.max(span.start) - start + base
    };
    move_spans(node, &mut moved);
}

fn move_spans(node: &mut Node, moved: &mut impl FnMut(&Span) -> Span) {
    node.span = moved(&node.span);
    match &mut node.kind {
        Kind::List(items) => items.iter_mut().for_each(|n| move_spans(n, moved)),
        Kind::Map(entries) => {
            for entry in entries {
                entry.key_span = moved(&entry.key_span);
                move_spans(&mut entry.value, moved);
            }
        }
        _ => {}
    }
}
