//! A `with` block against the declarations of a manifest: SI numbers, defaults filled in, files hashed,
//! components looked up. Everything wrong is reported where it stands.

use crate::catalog::{CatalogEntry, CatalogError, Plugins};
use crate::check::{Given, choice, out_of_bounds, quantity};
use crate::diagnostics::{Diagnostic, Mention, Problems, Source};
use crate::hints::{list_help, number_help};
use crate::named::{named, unreadable};
use crate::resolved::{InputFile, PluginId};
use crate::yaml::{Kind, Node, Span};
use camino::Utf8PathBuf;
use indexmap::IndexMap;
use plyflow_model::given::AskedFor;
use plyflow_model::manifest::{Bounds, Declaration, Items, PluginKind, Shape, Unfit};
use serde_json::{Map, Value, json};
use std::rc::Rc;

/// Resolves the parameters of one step.
pub(crate) struct Resolver<'a> {
    /// Finds components.
    pub catalog: &'a Plugins<'a>,
    /// Where findings go.
    pub problems: &'a mut Problems,
    /// Components met so far, with the JSON pointer of the parameter that names them.
    pub components: Vec<(String, PluginId)>,
    /// Plugins of materials as their files name them, which may be by a path from there, with the JSON pointer of the parameter.
    pub material_plugins: Vec<(String, Source, String)>,
    /// Files met so far.
    pub files: Vec<InputFile>,
    /// What scenes ask other steps for: where, and what.
    pub asked: Vec<(Source, Span, AskedFor)>,
}

/// Where a value is: its file, its JSON pointer in the step's parameters, its name for messages, and the
/// place of its key, to point at when the value has no extent.
#[derive(Clone)]
pub(crate) struct Place<'s> {
    /// The file.
    pub source: &'s Source,
    /// JSON pointer.
    pub pointer: String,
    /// Name for messages.
    pub what: String,
    /// Place of the key.
    pub key: Span,
}

impl<'s> Place<'s> {
    /// The value that stands there.
    pub fn of<'n>(&'n self, node: &'n Node) -> Given<'n> {
        Given {
            node,
            what: &self.what,
            key: &self.key,
            source: self.source,
        }
    }

    /// A value below this one.
    pub fn below(&self, name: &str, what: String, key: &Span) -> Place<'s> {
        let escaped = name.replace('~', "~0").replace('/', "~1");
        Place {
            source: self.source,
            pointer: format!("{}/{escaped}", self.pointer),
            what,
            key: key.clone(),
        }
    }
}

impl<'a> Resolver<'a> {
    /// For one step.
    pub fn new(catalog: &'a Plugins<'a>, problems: &'a mut Problems) -> Self {
        Resolver {
            catalog,
            problems,
            components: Vec::new(),
            material_plugins: Vec::new(),
            files: Vec::new(),
            asked: Vec::new(),
        }
    }

    /// Resolves a mapping of declared names. `owner` is whose parameters they are, for messages. Returns
    /// what could be resolved; whether all could be is told by the findings.
    pub fn mapping(
        &mut self,
        node: Option<&Node>,
        declared: &IndexMap<String, Declaration>,
        owner: &str,
        at: &Place<'_>,
    ) -> Value {
        let mut resolved = Map::new();
        let node = node.filter(|n| n.kind != Kind::Null);
        if let Some(node) = node {
            if !matches!(node.kind, Kind::Map(_)) {
                self.wrong(node, at, "a mapping of parameters");
                return Value::Object(resolved);
            }
            for entry in node
                .entries()
                .iter()
                .filter(|e| !declared.contains_key(&e.key))
            {
                let message = format!("`{}` is no parameter of {owner}", entry.key);
                let d = self.problems.add(at.source, &entry.key_span, message);
                d.given(entry.key.clone())
                    .suggest(&entry.key, declared.keys().map(String::as_str));
                if declared.is_empty() {
                    d.expected("no parameters");
                }
            }
        }
        for (name, declaration) in declared {
            let entry = node.and_then(|n| n.entry(name));
            match entry.filter(|e| e.value.kind != Kind::Null) {
                Some(entry) => {
                    let place = at.below(name, name.clone(), &entry.key_span);
                    if let Some(value) = self.value(&entry.value, declaration, &place) {
                        resolved.insert(name.clone(), value);
                    }
                }
                None if declaration.required => {
                    let span = entry.map_or(&at.key, |e| &e.key_span);
                    let message = format!("{owner} needs the parameter `{name}`");
                    let d = self.problems.add(at.source, span, message);
                    d.expected(format!("`{name}:` {}", declaration.shape.expected()));
                    d.help = (!declaration.doc.is_empty())
                        .then(|| format!("{name}: {}", declaration.doc));
                }
                None => {
                    let Some(default) = &declaration.default else {
                        continue;
                    };
                    let place = at.below(name, format!("{name} (default of {owner})"), &at.key);
                    let node = Node::from_json(default, &at.key);
                    if let Some(value) = self.value(&node, declaration, &place) {
                        resolved.insert(name.clone(), value);
                    }
                }
            }
        }
        Value::Object(resolved)
    }

    /// Resolves one value; `None` when it is wrong (and reported).
    pub fn value(&mut self, node: &Node, d: &Declaration, at: &Place<'_>) -> Option<Value> {
        match &d.shape {
            Shape::Boolean => match node.kind {
                Kind::Bool(b) => Some(json!(b)),
                _ => self.wrong(node, at, "`true` or `false`"),
            },
            Shape::Integer(bounds) => match &node.kind {
                Kind::Number(n) if n.is_i64() || n.is_u64() => {
                    self.bounded(n.as_f64()?, bounds, node, at)?;
                    Some(Value::Number(n.clone()))
                }
                _ => self.wrong(node, at, "a whole number"),
            },
            Shape::Number(bounds) => match &node.kind {
                Kind::Number(n) => self.bounded(n.as_f64()?, bounds, node, at),
                _ => self.wrong(node, at, "a plain number such as `0.3`"),
            },
            Shape::String => match node.text() {
                Some(text) => Some(json!(text)),
                None => self.wrong(node, at, "text"),
            },
            Shape::Choice(values) => {
                let names: Vec<&str> = values.iter().map(String::as_str).collect();
                choice(&at.of(node), &names, self.problems).map(|v| json!(v))
            }
            Shape::Quantity(dimension, bounds) => {
                let v = quantity(&at.of(node), *dimension, self.problems)?;
                self.bounded(v, bounds, node, at)
            }
            Shape::List(of, items) => self.list(node, of, items, at),
            Shape::Map(of) => self.map(node, of, at),
            Shape::Object(fields) => match node.kind {
                Kind::Map(_) => {
                    let before = self.problems.count();
                    let value = self.mapping(Some(node), fields, &format!("`{}`", at.what), at);
                    (self.problems.count() == before).then_some(value)
                }
                _ => self.wrong(node, at, &d.shape.expected()),
            },
            Shape::Scene { straight_fibres } => {
                crate::scene::resolve(self, node, at, *straight_fibres)
            }
            Shape::SheetMaterial => crate::scene::sheet_material(self, node, at),
            Shape::File => match node.text() {
                Some(text) => self.file(text, node, at).map(|path| json!(path)),
                None => self.wrong(node, at, "the path of a file"),
            },
            Shape::Component(kind) => self.component(node, *kind, at),
        }
    }

    /// Reports a value of the wrong type.
    fn wrong(&mut self, node: &Node, at: &Place<'_>, expected: &str) -> Option<Value> {
        let span = if node.kind == Kind::Null {
            &at.key
        } else {
            &node.span
        };
        let message = format!("`{}` is {}", at.what, node.describe());
        let d = self.problems.add(at.source, span, message);
        d.given(node.describe()).expected(expected);
        d.help = match node.kind {
            Kind::Number(_) | Kind::Bool(_) if expected == "text" => {
                Some("put it in quotes".into())
            }
            _ if expected == "a whole number" => number_help(node, true),
            _ if expected.starts_with("a plain number") => number_help(node, false),
            _ if expected.starts_with("a list") => list_help(node, &at.what),
            _ => None,
        };
        None
    }

    fn bounded(&mut self, v: f64, bounds: &Bounds, node: &Node, at: &Place<'_>) -> Option<Value> {
        if let Some(expected) = bounds.broken_by(v) {
            out_of_bounds(node, &at.what, expected, at.source, self.problems);
            return None;
        }
        Some(json!(v))
    }

    fn list(
        &mut self,
        node: &Node,
        of: &Declaration,
        must: &Items,
        at: &Place<'_>,
    ) -> Option<Value> {
        let Kind::List(items) = &node.kind else {
            let expected = format!("a list, each item {}", of.shape.expected());
            return self.wrong(node, at, &expected);
        };
        // All items are looked at before the first wrong one makes the list wrong.
        let resolved: Vec<Option<Value>> = items
            .iter()
            .enumerate()
            .map(|(i, item)| {
                let place = at.below(&i.to_string(), format!("{}[{i}]", at.what), &item.span);
                self.value(item, of, &place)
            })
            .collect();
        let resolved = resolved.into_iter().collect::<Option<Vec<Value>>>()?;
        if let Some(expected) = must.broken_by_count(resolved.len()) {
            let given = match resolved.len() {
                1 => "1 item".to_owned(),
                n => format!("{n} items"),
            };
            let message = format!("`{}` has {given}", at.what);
            let d = self.problems.add(at.source, &node.span, message);
            d.given(given).expected(expected);
            return None;
        }
        let numbers: Option<Vec<f64>> = resolved.iter().map(Value::as_f64).collect();
        let unfit = numbers.and_then(|n| must.broken_by_order(&n));
        if let Some(Unfit {
            item: Some(i),
            expected,
        }) = unfit
        {
            let [before, item] = [&items[i - 1], &items[i]];
            let message = format!("`{}[{i}]` does not follow the item before it", at.what);
            let d = self.problems.add(at.source, &item.span, message);
            d.given(format!("{} after {}", item.describe(), before.describe()))
                .expected(expected);
            return None;
        }
        Some(Value::Array(resolved))
    }

    fn map(&mut self, node: &Node, of: &Declaration, at: &Place<'_>) -> Option<Value> {
        let Kind::Map(entries) = &node.kind else {
            let expected = format!("a mapping of names, each {}", of.shape.expected());
            return self.wrong(node, at, &expected);
        };
        let resolved: Vec<Option<(String, Value)>> = entries
            .iter()
            .map(|e| {
                let place = at.below(&e.key, format!("{}.{}", at.what, e.key), &e.key_span);
                self.value(&e.value, of, &place).map(|v| (e.key.clone(), v))
            })
            .collect();
        resolved
            .into_iter()
            .collect::<Option<Map<String, Value>>>()
            .map(Value::Object)
    }

    /// Reads a file that a parameter names: hashes it and returns its absolute path.
    pub fn file(&mut self, text: &str, node: &Node, at: &Place<'_>) -> Option<Utf8PathBuf> {
        let path = named(self.problems, &at.source.folder, text);
        // Read in this pass already, perhaps for another point of a study.
        let known = self.problems.files().get(&path).filter(|h| !h.is_empty());
        match known.map_or_else(|| crate::evidence::hash_file(&path), |h| Ok(h.clone())) {
            Ok(hash) => {
                self.problems.note_file(&path, &hash);
                self.files.push(InputFile {
                    pointer: at.pointer.clone(),
                    path: path.clone(),
                    hash,
                });
                Some(path)
            }
            Err(e) => {
                let given = Mention::new(at.source, &node.span, text);
                unreadable(self.problems, &given, &path, &e);
                None
            }
        }
    }

    fn component(&mut self, node: &Node, kind: PluginKind, at: &Place<'_>) -> Option<Value> {
        match &node.kind {
            Kind::Text(name) => self.plugin_with(name, &node.span, None, kind, at),
            Kind::Map(entries) => {
                for e in entries
                    .iter()
                    .filter(|e| e.key != "plugin" && e.key != "with")
                {
                    let names = ["plugin", "with"];
                    crate::check::unknown_key(e, &at.what, names, at.source, self.problems);
                }
                let Some(plugin) = node.get("plugin") else {
                    let message = format!("`plugin` is missing in `{}`", at.what);
                    let d = self.problems.add(at.source, &at.key, message);
                    d.expected(Shape::Component(kind).expected());
                    return None;
                };
                match plugin.text() {
                    Some(name) => {
                        self.plugin_with(name, &plugin.span, node.entry("with"), kind, at)
                    }
                    None => self.wrong(plugin, at, &Shape::Component(kind).expected()),
                }
            }
            _ => self.wrong(node, at, &Shape::Component(kind).expected()),
        }
    }

    /// Looks a component up and resolves its own parameters:
    /// `{"plugin": name in its manifest, "with": {..}}`.
    pub fn plugin_with(
        &mut self,
        name: &str,
        span: &Span,
        with: Option<&crate::yaml::Entry>,
        kind: PluginKind,
        at: &Place<'_>,
    ) -> Option<Value> {
        let mention = Mention::new(at.source, span, name);
        let found = find(self.catalog, self.problems, &mention, kind)?;
        let manifest = &found.manifest;
        // Components are told apart by name inside a step.
        let clash = self
            .components
            .iter()
            .find(|(_, id)| id.name == found.id.name && id.hash != found.id.hash);
        if let Some((_, other)) = clash {
            let message = format!(
                "two different libraries name themselves `{}`",
                found.id.name
            );
            let d = self.problems.add(at.source, span, message);
            d.given(found.id.path.to_string())
                .help(format!("the other one is {}", other.path));
            return None;
        }
        self.components.push((at.pointer.clone(), found.id.clone()));
        let before = self.problems.count();
        let key = with.map_or(span, |e| &e.key_span);
        let place = at.below("with", "with".into(), key);
        let owner = format!("`{}`", manifest.name);
        let with = self.mapping(with.map(|e| &e.value), &manifest.parameters, &owner, &place);
        (self.problems.count() == before).then(|| json!({"plugin": manifest.name, "with": with}))
    }

    /// The components by JSON pointer, each library once.
    pub fn components_in_order(&mut self) -> Vec<PluginId> {
        self.components.sort_by(|a, b| a.0.cmp(&b.0));
        let mut ids: Vec<PluginId> = Vec::new();
        for (_, id) in &self.components {
            if !ids.contains(id) {
                ids.push(id.clone());
            }
        }
        ids
    }
}

/// Finds a plugin of a kind or reports why there is none.
pub(crate) fn find(
    catalog: &Plugins<'_>,
    problems: &mut Problems,
    &Mention {
        source,
        span,
        text: name,
    }: &Mention<'_>,
    kind: PluginKind,
) -> Option<Rc<CatalogEntry>> {
    let with_article = |kind: PluginKind| match kind {
        PluginKind::Element => format!("an {kind}"),
        _ => format!("a {kind}"),
    };
    match catalog.find(name, &source.folder) {
        Ok(entry) if entry.manifest.kind == kind => return Some(entry),
        Ok(entry) => {
            let [found, wanted] = [entry.manifest.kind, kind].map(with_article);
            let message = format!("`{name}` is {found} plugin, not {wanted} plugin");
            let names = catalog.names(kind);
            let d = problems.add(source, span, message);
            d.given(name)
                .suggest(name, names.iter().map(String::as_str));
        }
        Err(e) => {
            let names = catalog.names(kind);
            let d = problems.add(source, span, e.to_string());
            d.once();
            d.given(name)
                .expected(format!("{} plugin", with_article(kind)));
            match &e {
                CatalogError::NotFound { searched, .. } => {
                    not_found(d, name, searched, &names, kind)
                }
                CatalogError::Broken { path, .. } if path.extension() == Some("py") => {
                    d.help("the pages \"A step in Python\" and \"From an idea to a law\" of the book say what such a file needs; PLYFLOW_PYTHON names the interpreter");
                }
                CatalogError::Broken { .. } => {
                    d.help("rebuild the plugin against the ABI of this program");
                }
                // The message says what to do.
                CatalogError::NeedsConsent { .. } | CatalogError::Taken { .. } => {}
            }
        }
    }
    None
}

/// Says where a plugin was looked for, and what is there.
fn not_found(
    d: &mut Diagnostic,
    name: &str,
    searched: &[Utf8PathBuf],
    names: &[String],
    kind: PluginKind,
) {
    let places: Vec<&str> = searched.iter().map(|p| p.as_str()).collect();
    let known = if names.is_empty() {
        "none".into()
    } else {
        names.join(", ")
    };
    match plyflow_model::nearest::nearest(name, names.iter().map(String::as_str)) {
        Some(n) => d.help(format!("did you mean `{n}`?")),
        None => d.searched(places.join(", "), format!("{kind} plugins there: {known}")),
    };
}
