//! `plugins` and `schema`: what can be written into files.

use super::args::{PluginsArgs, SchemaArgs, SchemaKind, TextOrJson};
use super::keys;
use super::open::{catalog, folders, store_root};
use crate::exit;
use crate::said::{Done, Stop, print};
use camino::Utf8Path;
use plyflow_model::schema;
use plyflow_plugin_host::{PluginCatalog, manifest_file};
use plyflow_workflow::{Catalog, CatalogEntry, CatalogError};
use serde_json::{Value, json};

/// `plyflow plugins`.
///
/// # Errors
/// [`exit::USAGE`] when the named plugin is not found or broken.
pub fn plugins(args: &PluginsArgs) -> Done {
    let file = args.workflow.as_deref();
    let folders = folders(&args.places, file)?;
    let catalog = catalog(folders, &args.places, &store_root(&args.places, file))?;
    let Some(name) = &args.name else {
        return list(&catalog.plugins(), &catalog.broken(), args.format);
    };
    let here = Utf8Path::new(".");
    let entry = catalog.find(name, here).map_err(|e| {
        let more = match &e {
            CatalogError::NotFound { searched, .. } => {
                let folders: Vec<&str> = searched.iter().map(|f| f.as_str()).collect();
                format!("; searched: {}", folders.join(", "))
            }
            _ => String::new(),
        };
        Stop::new(exit::USAGE, format!("{e}{more}"))
    })?;
    if args.write_manifest {
        return write_manifest(&entry, &catalog);
    }
    show(&entry, args.format)
}

/// Writes what a library says of itself beside it, for those who may not load it.
fn write_manifest(e: &CatalogEntry, catalog: &PluginCatalog) -> Done {
    // From the library itself: what lies beside it now may be what is to be replaced.
    catalog
        .admit(&e.id)
        .map_err(|e| Stop::new(exit::USAGE, e))?;
    let file = manifest_file(&e.id.path);
    let text = serde_json::to_string_pretty(&e.manifest).unwrap_or_default() + "\n";
    std::fs::write(&file, text).map_err(Stop::machine(format!("writing {file}")))?;
    print(&format!("{file}: written\n"))
}

fn list(
    entries: &[CatalogEntry],
    broken: &[(camino::Utf8PathBuf, String)],
    format: TextOrJson,
) -> Done {
    if format == TextOrJson::Json {
        let all: Vec<Value> = entries.iter().map(as_json).collect();
        let bad: Vec<Value> = broken
            .iter()
            .map(|(p, r)| json!({"path": p, "reason": r}))
            .collect();
        return print(&format!("{:#}\n", json!({"plugins": all, "broken": bad})));
    }
    let mut out = String::new();
    for e in entries {
        let m = &e.manifest;
        let role = if m.role == m.kind.name() {
            String::new()
        } else {
            format!(", {}", m.role)
        };
        out += &format!("{} {} ({}{role})\n", e.id.name, e.id.version, m.kind);
        out += &format!("    {}\n    {}\n", m.summary, e.id.path);
    }
    for (path, reason) in broken {
        out += &format!("broken: {path}: {reason}\n");
    }
    print(&out)
}

fn as_json(e: &CatalogEntry) -> Value {
    json!({"path": e.id.path, "hash": e.id.hash, "manifest": e.manifest})
}

fn show(e: &CatalogEntry, format: TextOrJson) -> Done {
    if format == TextOrJson::Json {
        return print(&format!("{:#}\n", as_json(e)));
    }
    let m = &e.manifest;
    let mut out = format!(
        "{} {} ({}, role {}) by {}\n{}\n{}\nblake3 {}\n",
        e.id.name, e.id.version, m.kind, m.role, m.vendor, m.summary, e.id.path, e.id.hash
    );
    let manifest = serde_json::to_value(m).unwrap_or_default();
    if let Some(parameters) = manifest["parameters"].as_object().filter(|p| !p.is_empty()) {
        out += "\nparameters (`with:`)\n";
        for (name, declaration) in parameters {
            parameter(name, declaration, 1, &mut out);
        }
    }
    if !m.inputs.is_empty() {
        out += "\ninputs (`from:`)\n";
        for (port, input) in &m.inputs {
            let need = if input.required { "" } else { ", optional" };
            let many = if input.many { ", several" } else { "" };
            out += &format!(
                "  {port}: {}{need}{many}\n      {}\n",
                input.kind, input.doc
            );
        }
    }
    if let Some(output) = &m.output {
        let collection = if output.collection {
            ", a collection (`for_each`)"
        } else {
            ""
        };
        out += &format!("\noutput: {}{collection}\n", output.kind);
    }
    if !m.results.is_empty() {
        out += "\nresults\n";
        for (name, r) in &m.results {
            out += &format!("  {name} [{}]\n      {}\n", r.unit, r.doc);
        }
    }
    if !m.fields.is_empty() {
        out += "\nfields\n";
        for f in &m.fields {
            out += &format!("  {} [{}]  {}\n", f.name, f.unit, f.doc);
        }
    }
    print(&out)
}

/// One parameter and, indented, what it is made of.
fn parameter(name: &str, d: &Value, depth: usize, out: &mut String) {
    let pad = "  ".repeat(depth);
    let word = |key: &str| {
        d.get(key)
            .map(|v| v.as_str().map_or_else(|| v.to_string(), str::to_owned))
    };
    let mut facts = vec![word("type").unwrap_or_default()];
    for (key, label) in [
        ("dimension", ""),
        ("values", "one of "),
        ("default", "default "),
        ("minimum", "at least "),
        ("exclusive_minimum", "more than "),
        ("maximum", "at most "),
        ("minimum_items", "items at least "),
        ("maximum_items", "items at most "),
        ("order", "order "),
    ] {
        if let Some(text) = word(key) {
            facts.push(format!("{label}{text}"));
        }
    }
    if d.get("required") == Some(&Value::Bool(true)) {
        facts.push("required".into());
    }
    *out += &format!("{pad}{name}: {}\n", facts.join(", "));
    if let Some(doc) = word("doc").filter(|t| !t.is_empty()) {
        *out += &format!("{pad}    {doc}\n");
    }
    if let Some(of) = d.get("of") {
        parameter("of", of, depth + 1, out);
    }
    if let Some(fields) = d.get("fields").and_then(Value::as_object) {
        for (name, field) in fields {
            parameter(name, field, depth + 1, out);
        }
    }
}

/// `plyflow schema`.
///
/// # Errors
/// See [`Stop`].
pub fn schema(args: &SchemaArgs) -> Done {
    let text = match args.which {
        // People read the types alone; editors must not call an expression wrong.
        SchemaKind::PlainWorkflow => match args.format {
            TextOrJson::Json => schema::workflow_for_editors(),
            TextOrJson::Text => schema::workflow(),
        },
        SchemaKind::Scene => schema::scene(),
        SchemaKind::Material => schema::material(),
        SchemaKind::Expected => schema::expected(),
        SchemaKind::Profile => schema::profile(),
        SchemaKind::Artifacts => schema::artifacts(),
        SchemaKind::Workflow => {
            let folders = folders(&args.places, None)?;
            let catalog = catalog(folders, &args.places, &store_root(&args.places, None))?;
            let manifests: Vec<_> = catalog.plugins().into_iter().map(|e| e.manifest).collect();
            schema::workflow_with(&manifests)
        }
    };
    match args.format {
        TextOrJson::Json => print(&format!("{text:#}\n")),
        TextOrJson::Text => print(&keys::outline(&text)),
    }
}
