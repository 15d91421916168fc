//! Scenes: a file or a mapping -> canonical JSON with its materials inside.

use crate::check::{Checker, repeated_keys};
use crate::diagnostics::{Mention, Problems, Source};
use crate::hints::other_format;
use crate::named::{named, unreadable};
use crate::parameters::{Place, Resolver, find};
use crate::paths;
use crate::plies;
use crate::scene_rules;
use crate::text::written;
use crate::yaml::{Kind, Node, Span};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::open::{self, MOST_WRITTEN};
use plyflow_model::manifest::{PluginKind, Shape};
use plyflow_model::{given, material::Material, scene::Scene, schema};
use serde_json::{Value, json};
use std::sync::{Arc, LazyLock};

static SCENE: LazyLock<Value> = LazyLock::new(schema::scene);
static MATERIAL: LazyLock<Value> = LazyLock::new(schema::material);

/// Reads a YAML file named in another one; repeated keys are reported. `None` when that failed (and is
/// reported).
pub fn read(
    problems: &mut Problems,
    from: &Source,
    span: &Span,
    given: &str,
) -> Option<(Source, Node)> {
    let path = named(problems, &from.folder, given);
    if let Some(known) = problems.parsed(&path) {
        return Some(known);
    }
    let bytes = match open::read(path.as_std_path(), MOST_WRITTEN) {
        Ok(bytes) => bytes,
        Err(e) => {
            let given = Mention::new(from, span, given);
            unreadable(problems, &given, &path, &e);
            return None;
        }
    };
    let file = parse(problems, path.clone(), bytes)?;
    problems.keep_parsed(&path, &file);
    Some(file)
}

/// Parses the bytes of a file.
pub fn parse(problems: &mut Problems, path: Utf8PathBuf, bytes: Vec<u8>) -> Option<(Source, Node)> {
    problems.note_file(&path, &crate::evidence::hash(&bytes));
    let text = match written(bytes) {
        Ok(text) => text,
        Err(why) => {
            problems.add_unreadable(&shown(&path), why.to_string());
            return None;
        }
    };
    let folder = path
        .parent()
        .map_or_else(Utf8PathBuf::new, |p| p.to_owned());
    let source = Source {
        name: path,
        folder,
        text: Arc::new(text),
        set: Vec::new(),
    };
    match crate::yaml::parse(&source.text) {
        Ok(node) => {
            repeated_keys(&node, &source, problems);
            Some((source, node))
        }
        Err(e) => {
            let d = problems.add(
                &source,
                &e.span,
                format!("this is no valid YAML: {}", e.message),
            );
            d.help("check indentation, brackets, quotes and colons at and above this line");
            None
        }
    }
}

/// The path as messages show it: relative when it lies below the current folder.
fn shown(path: &Utf8Path) -> Utf8PathBuf {
    let here = std::env::current_dir()
        .ok()
        .and_then(|d| Utf8PathBuf::from_path_buf(d).ok());
    here.and_then(|here| path.strip_prefix(here).ok().map(Utf8Path::to_owned))
        .unwrap_or_else(|| path.to_owned())
}

/// Resolves a parameter of type `scene`.
///
/// `straight_fibres`: whether the step cannot compute steered fibres.
pub fn resolve(
    resolver: &mut Resolver<'_>,
    node: &Node,
    at: &Place<'_>,
    straight_fibres: bool,
) -> Option<Value> {
    match &node.kind {
        Kind::Text(file) => {
            let (source, scene) = read(resolver.problems, at.source, &node.span, file)?;
            let place = Place {
                source: &source,
                key: scene.span.clone(),
                ..at.clone()
            };
            scene_value(resolver, &scene, &place, straight_fibres)
        }
        Kind::Map(_) if node.get("file").is_some() => {
            changed_scene(resolver, node, at, straight_fibres)
        }
        Kind::Map(_) => scene_value(resolver, node, at, straight_fibres),
        _ => {
            let message = format!("`{}` is {}", at.what, node.describe());
            let d = resolver.problems.add(at.source, &node.span, message);
            d.given(node.describe())
                .expected("the path of a scene file, or a scene");
            None
        }
    }
}

/// The scene of `{file: .., set: {..}}`, where `set` has values by their path in the file.
fn changed_scene(
    resolver: &mut Resolver<'_>,
    node: &Node,
    at: &Place<'_>,
    straight_fibres: bool,
) -> Option<Value> {
    only_keys(resolver, node, at, &["file", "set"]);
    let file = file_of(resolver, node, at, "the path of a scene file")?;
    let (mut source, mut scene) = read(resolver.problems, at.source, &file.span, file.text()?)?;
    let before = resolver.problems.count();
    if let Some(set) = node.entry("set") {
        paths::apply(&mut scene, &mut source, set, at.source, resolver.problems);
    }
    let place = Place {
        source: &source,
        key: scene.span.clone(),
        ..at.clone()
    };
    let value = scene_value(resolver, &scene, &place, straight_fibres);
    value.filter(|_| resolver.problems.count() == before)
}

fn only_keys(resolver: &mut Resolver<'_>, node: &Node, at: &Place<'_>, known: &[&str]) {
    for e in node
        .entries()
        .iter()
        .filter(|e| !known.contains(&e.key.as_str()))
    {
        let names = known.iter().copied();
        crate::check::unknown_key(e, &at.what, names, at.source, resolver.problems);
    }
}

/// What `file` of a mapping says, if it is a text.
fn file_of<'n>(
    resolver: &mut Resolver<'_>,
    node: &'n Node,
    at: &Place<'_>,
    expected: &str,
) -> Option<&'n Node> {
    let file = node.get("file")?;
    if file.text().is_none() {
        let message = format!("`file` is {}", file.describe());
        let d = resolver.problems.add(at.source, &file.span, message);
        d.given(file.describe()).expected(expected);
    }
    Some(file)
}

/// The canonical form of a scene. `straight_fibres`: whether the step cannot compute steered fibres.
pub fn scene_value(
    resolver: &mut Resolver<'_>,
    node: &Node,
    at: &Place<'_>,
    straight_fibres: bool,
) -> Option<Value> {
    let before = resolver.problems.count();
    let wanted = "a scene, with `plyflow_scene: 1`";
    if other_format(node, "plyflow_scene", wanted, at.source, resolver.problems) {
        return None;
    }
    Checker::new(&SCENE, at.source, resolver.problems).check(node, "the scene");
    let filled = plies::fill(node, at.source, resolver.problems);
    let (mut node, source) = (filled.scene, filled.source);
    let at = &Place {
        source: &source,
        ..at.clone()
    };
    let found = resolver.problems.places_from(before);
    let files = stl_files(resolver, &node, at);
    let materials = materials(resolver, &node, at);
    plies::rows::cross(&mut node, &materials);
    let node = &node;
    // Rules look at all sheets: without those of a book that could not be read they would find what is none.
    if filled.sound {
        scene_rules::tell(node, &materials, &found, at.source, resolver.problems);
    }
    steered(node, at, straight_fibres, resolver.problems);
    if resolver.problems.count() > before {
        return None;
    }
    let mut scene = node.to_json();
    for (pointer, path) in files {
        if let Some(file) = scene.pointer_mut(&format!("/{pointer}")) {
            *file = json!(path);
        }
    }
    for (i, material) in materials.into_iter().enumerate() {
        scene["sheets"][i]["material"] = material?;
    }
    match Scene::from_json(scene).and_then(|mut scene| {
        // Prose does not matter to any result.
        scene.description = None;
        for (path, asked) in given::asks(&scene) {
            let span = scene_rules::place(node, &path);
            resolver.asked.push((at.source.clone(), span, asked));
        }
        serde_json::to_value(scene)
    }) {
        Ok(value) => Some(value),
        Err(e) => {
            // The schema is made from the types, so that only what it cannot say comes here.
            resolver
                .problems
                .add(at.source, &at.key, format!("the scene cannot be read: {e}"));
            None
        }
    }
}

/// Reports the plies whose fibres are steered, for a step that cannot do with them.
fn steered(scene: &Node, at: &Place<'_>, straight_fibres: bool, problems: &mut Problems) {
    if !straight_fibres {
        return;
    }
    for sheet in scene.get("sheets").map_or(&[][..], Node::items) {
        let Some(fibres) = sheet.get("fibre_1") else {
            continue;
        };
        if ["points", "table"].iter().any(|k| fibres.get(k).is_some()) {
            let name = sheet.get("name").and_then(Node::text).unwrap_or_default();
            let message =
                format!("the fibres of ply `{name}` are steered, which this step cannot compute");
            let d = problems.add(at.source, &fibres.span, message);
            d.expected(
                "one direction for all of the ply, such as `fibre_1: 0 deg` with `fibre_2: 90 deg`",
            );
            d.help("forming-explicit forms steered plies");
        }
    }
}

/// The files of the scene's tool and of the rigid parts of a stamping, each with its pointer in the scene.
fn stl_files(
    resolver: &mut Resolver<'_>,
    scene: &Node,
    at: &Place<'_>,
) -> Vec<(String, Utf8PathBuf)> {
    let own = scene.get("tool").map(|tool| ("tool".to_owned(), tool));
    let stamping = scene.get("process").and_then(|p| p.get("stamping"));
    let parts = stamping.and_then(|s| s.get("parts"));
    let parts = parts.map_or(&[][..], Node::items).iter().enumerate();
    let parts = parts.filter_map(|(k, part)| {
        let pointer = format!("process/stamping/parts/{k}/tool");
        Some((pointer, part.get("tool")?))
    });
    let tools: Vec<(String, &Node)> = own.into_iter().chain(parts).collect();
    let files = tools.into_iter().filter_map(|(pointer, tool)| {
        let pointer = format!("{pointer}/stl/file");
        let path = stl_file(resolver, tool, &pointer, at)?;
        Some((pointer, path))
    });
    files.collect()
}

fn stl_file(
    resolver: &mut Resolver<'_>,
    tool: &Node,
    pointer: &str,
    at: &Place<'_>,
) -> Option<Utf8PathBuf> {
    let entry = tool.get("stl")?.entry("file")?;
    let text = entry.value.text()?;
    let place = at.below(pointer, "file".into(), &entry.key_span);
    let place = Place {
        pointer: format!("{}/{pointer}", at.pointer),
        ..place
    };
    resolver.file(text, &entry.value, &place)
}

/// The resolved material of every sheet; `None` where it is wrong.
fn materials(resolver: &mut Resolver<'_>, scene: &Node, at: &Place<'_>) -> Vec<Option<Value>> {
    let sheets = scene.get("sheets").map_or(&[][..], Node::items);
    let mut all = Vec::new();
    for (i, sheet) in sheets.iter().enumerate() {
        let Some(entry) = sheet.entry("material") else {
            all.push(None);
            continue;
        };
        let place = Place {
            source: at.source,
            pointer: format!("{}/sheets/{i}/material", at.pointer),
            what: "material".into(),
            key: entry.key_span.clone(),
        };
        all.push(match &entry.value.kind {
            Kind::Text(file) => material_file(resolver, &entry.value.span, file, &place),
            // The scene's schema has looked at what is written inside it.
            Kind::Map(_) if entry.value.get("file").is_some() => {
                varied_material(resolver, &entry.value, &place)
            }
            Kind::Map(_) => material_value(resolver, &entry.value, &place, true),
            _ => None,
        });
    }
    all
}

/// The material of a file that `at` names.
fn material_file(
    resolver: &mut Resolver<'_>,
    span: &Span,
    file: &str,
    at: &Place<'_>,
) -> Option<Value> {
    let (source, node) = read(resolver.problems, at.source, span, file)?;
    let place = Place {
        source: &source,
        key: node.span.clone(),
        ..at.clone()
    };
    checked_material(resolver, &node, &place)
}

/// The canonical form of a material.
pub fn checked_material(resolver: &mut Resolver<'_>, node: &Node, at: &Place<'_>) -> Option<Value> {
    let before = resolver.problems.count();
    let wanted = "a material, with `plyflow_material: 1`";
    if other_format(
        node,
        "plyflow_material",
        wanted,
        at.source,
        resolver.problems,
    ) {
        return None;
    }
    Checker::new(&MATERIAL, at.source, resolver.problems).check(node, "the material");
    let sound = resolver.problems.count() == before;
    material_value(resolver, node, at, sound)
}

/// Resolves a parameter of type `sheet_material`: a file, a material, or `{file: .., with: {..}, set: {..}}`, where every
/// parameter under `with` takes the place of the file's own (`null` removes it), and every value under `set` that at its path.
pub fn sheet_material(resolver: &mut Resolver<'_>, node: &Node, at: &Place<'_>) -> Option<Value> {
    let expected = Shape::SheetMaterial.expected();
    match &node.kind {
        Kind::Text(file) => material_file(resolver, &node.span, file, at),
        Kind::Map(_) if node.get("file").is_some() => {
            only_keys(resolver, node, at, &["file", "with", "set"]);
            file_of(resolver, node, at, "the path of a material file")?;
            varied_material(resolver, node, at)
        }
        Kind::Map(_) => checked_material(resolver, node, at),
        _ => {
            let message = format!("`{}` is {}", at.what, node.describe());
            let d = resolver.problems.add(at.source, &node.span, message);
            d.given(node.describe()).expected(expected);
            None
        }
    }
}

/// The material of `{file: .., with: {..}, set: {..}}`, whose keys have been checked.
fn varied_material(resolver: &mut Resolver<'_>, node: &Node, at: &Place<'_>) -> Option<Value> {
    let file = node.get("file")?;
    let before = resolver.problems.count();
    let (mut source, mut tree) = read(resolver.problems, at.source, &file.span, file.text()?)?;
    if let Some(set) = node.entry("set") {
        paths::apply(&mut tree, &mut source, set, at.source, resolver.problems);
    }
    let place = Place {
        source: &source,
        key: tree.span.clone(),
        ..at.clone()
    };
    let mut material = checked_material(resolver, &tree, &place)?;
    if resolver.problems.count() > before {
        return None;
    }
    let with = node.entry("with").filter(|e| e.value.kind != Kind::Null);
    if let Some(with) = with {
        override_parameters(resolver, &with.value, &mut material, at)?;
    }
    Some(material)
}

/// Puts single parameters into a resolved material.
fn override_parameters(
    resolver: &mut Resolver<'_>,
    with: &Node,
    material: &mut Value,
    at: &Place<'_>,
) -> Option<()> {
    let name = material["plugin"].as_str()?.to_owned();
    let (kind, catalog) = (PluginKind::Material, resolver.catalog);
    // As the material's file names it: perhaps by a path from there.
    let mut named = resolver.material_plugins.iter().rev();
    let (_, source, plugin) = named.find(|(pointer, ..)| *pointer == at.pointer)?;
    let mention = Mention::new(source, &with.span, plugin);
    let found = find(catalog, resolver.problems, &mention, kind)?;
    if !matches!(with.kind, Kind::Map(_)) {
        let message = format!("`with` is {}", with.describe());
        let d = resolver.problems.add(at.source, &with.span, message);
        d.expected("a mapping of parameters");
        return None;
    }
    let declared = &found.manifest.parameters;
    let before = resolver.problems.count();
    for entry in with.entries() {
        let Some(declaration) = declared.get(&entry.key) else {
            let message = format!("`{}` is no parameter of `{name}`", entry.key);
            let d = resolver.problems.add(at.source, &entry.key_span, message);
            d.given(entry.key.clone())
                .suggest(&entry.key, declared.keys().map(String::as_str));
            continue;
        };
        let place = at.below(&entry.key, entry.key.clone(), &entry.key_span);
        if entry.value.kind == Kind::Null {
            if declaration.required {
                let message = format!("`{name}` needs the parameter `{}`", entry.key);
                resolver
                    .problems
                    .add(at.source, &entry.key_span, message)
                    .help("`null` takes a parameter away; give a value instead");
            } else if let Some(map) = material["with"].as_object_mut() {
                map.remove(&entry.key);
            }
        } else if let Some(value) = resolver.value(&entry.value, declaration, &place) {
            material["with"][&entry.key] = value;
        }
    }
    (resolver.problems.count() == before).then_some(())
}

/// The material with its parameters checked against its plugin, as JSON with SI numbers.
fn material_value(
    resolver: &mut Resolver<'_>,
    node: &Node,
    at: &Place<'_>,
    sound: bool,
) -> Option<Value> {
    let plugin = node.get("plugin")?;
    let name = plugin.text()?;
    let with = node.entry("with");
    let resolved = resolver.plugin_with(name, &plugin.span, with, PluginKind::Material, at)?;
    let named = (at.pointer.clone(), at.source.clone(), name.to_owned());
    resolver.material_plugins.push(named);
    if !sound {
        return None;
    }
    let mut value = node.to_json();
    value["plugin"] = resolved["plugin"].clone();
    value["with"] = resolved["with"].clone();
    let mut material: Material = serde_json::from_value(value).ok()?;
    material.source = None;
    serde_json::to_value(material).ok()
}
