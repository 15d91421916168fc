//! Loading a plugin library and checking that it keeps the contract of `plyflow.h`.

use camino::{Utf8Path, Utf8PathBuf};
use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
use plyflow_abi::*;
use plyflow_model::Manifest;
use plyflow_model::manifest::PluginKind;
use plyflow_model::units::check_si;
use std::ffi::c_void;

/// Why a library is not a plugin that this program can use.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct LoadError {
    /// The library.
    pub path: Utf8PathBuf,
    /// What was found, what is expected, what to do.
    pub reason: String,
    /// The library loads but is no Plyflow plugin at all (it exports no entry point).
    pub foreign: bool,
}

/// A loaded plugin. Its library stays loaded until the process ends.
#[derive(Debug, Clone)]
pub struct Plugin {
    /// The library.
    pub path: Utf8PathBuf,
    /// What it says about itself.
    pub manifest: Manifest,
    /// The same as text.
    pub manifest_text: &'static str,
    functions: *const c_void,
}

/// The fixed beginning of a descriptor: what may be read before its version is known.
#[repr(C)]
#[derive(Clone, Copy)]
struct Head {
    magic: u64,
    abi_major: u32,
    abi_minor: u32,
    size: u64,
}

impl Plugin {
    /// Loads a library: runs its initialisers, so only in a process that may die.
    ///
    /// # Errors
    /// When it cannot be loaded or breaks the contract.
    pub fn load(path: &Utf8Path) -> Result<Self, LoadError> {
        let fail = |foreign: bool, reason: String| LoadError {
            path: path.into(),
            reason,
            foreign,
        };
        if !path.is_file() {
            return Err(fail(false, "there is no such file".into()));
        }
        // dlopen searches the system's folders for a name without a slash.
        let full = path
            .canonicalize_utf8()
            .map_err(|e| fail(false, e.to_string()))?;
        let library = unsafe { Library::open(Some(full.as_std_path()), RTLD_NOW | RTLD_LOCAL) }
            .map_err(|e| {
                fail(
                    false,
                    format!(
                        "the library cannot be loaded: {}. Check that it was built for this \
                         machine and that the libraries it needs are installed (`ldd {full}`)",
                        full_text(&e)
                    ),
                )
            })?;
        let plugin = unsafe { library.get::<pf_entry>(PF_SYMBOL) }.map(|entry| unsafe { entry() });
        // Function tables and manifest live in the library.
        std::mem::forget(library);
        let Ok(plugin) = plugin else {
            return Err(fail(
                true,
                "it is not a Plyflow plugin: it does not export `plyflow_plugin`. A plugin written \
                 with the SDK ends with `export_step!`, `export_element!` or `export_material!`"
                    .into(),
            ));
        };
        if plugin.is_null() {
            return Err(fail(
                false,
                "`plyflow_plugin()` returned NULL instead of a descriptor".into(),
            ));
        }
        check_head(unsafe { plugin.cast::<Head>().read_unaligned() })
            .map_err(|e| fail(false, e))?;
        if !plugin.is_aligned() {
            return Err(fail(
                false,
                "`plyflow_plugin()` returned a descriptor that is not aligned as a pf_plugin"
                    .into(),
            ));
        }
        let descriptor = unsafe { &*plugin };
        Self::check(path, descriptor).map_err(|e| fail(false, e))
    }

    /// As [`Plugin::load`], but only when the bytes of the file are those that the user consented to (BLAKE3, hex); `None`: it lies
    /// where any bytes are trusted.
    ///
    /// # Errors
    /// As [`Plugin::load`], and when the bytes are others.
    pub fn load_bytes(path: &Utf8Path, hash: Option<&str>) -> Result<Self, LoadError> {
        if let Some(wanted) = hash {
            let fail = |reason: String| LoadError {
                path: path.into(),
                reason,
                foreign: false,
            };
            let found = hash_of(path).map_err(|e| fail(e.to_string()))?;
            if found != wanted {
                return Err(fail(format!(
                    "it is not the library that was consented to: its blake3 is {found}, expected {wanted}. It has \
                     changed since this command began; run it again"
                )));
            }
        }
        Self::load(path)
    }

    fn check(path: &Utf8Path, d: &'static pf_plugin) -> Result<Self, String> {
        let (kind, size) = match d.kind {
            PF_KIND_STEP => (PluginKind::Step, size_of::<pf_step_functions>()),
            PF_KIND_ELEMENT => (PluginKind::Element, size_of::<pf_element_functions>()),
            PF_KIND_MATERIAL => (PluginKind::Material, size_of::<pf_material_functions>()),
            other => {
                return Err(format!(
                    "its kind is {other}; expected {PF_KIND_STEP} (step), {PF_KIND_ELEMENT} \
                     (element) or {PF_KIND_MATERIAL} (material)"
                ));
            }
        };
        if d.functions.is_null() {
            return Err("its function table is NULL".into());
        }
        // No table has grown since ABI 1.0, so today's size is the least one for a plugin of any minor. When one grows,
        // the least size must be that of the plugin's own `abi_minor`: else every plugin built before is refused.
        let table = unsafe { d.functions.cast::<u64>().read_unaligned() };
        if table < size as u64 {
            return Err(format!(
                "its {kind} function table has {table} bytes; ABI {PF_ABI_MAJOR}.{PF_ABI_MINOR} \
                 expects at least {size}. Set `size` to the size of the table"
            ));
        }
        check_pointers(kind, d.functions)?;
        let text: &'static str = unsafe { d.manifest.as_str() }
            .map_err(|e| format!("its manifest is not UTF-8: {e}"))?;
        let manifest = read_manifest(text)?;
        if manifest.kind != kind {
            return Err(format!(
                "its descriptor says {kind}, its manifest says {}; they must agree",
                manifest.kind
            ));
        }
        Ok(Self {
            path: path.to_owned(),
            manifest,
            manifest_text: text,
            functions: d.functions,
        })
    }

    /// The function table of its kind; valid until the process ends.
    #[must_use]
    pub fn functions(&self) -> *const c_void {
        self.functions
    }
}

/// BLAKE3 of a file, hex.
pub(crate) fn hash_of(path: &Utf8Path) -> std::io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(std::fs::File::open(path)?)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// Reads a manifest by all of its rules; the error is a sentence.
pub(crate) fn read_manifest(text: &str) -> Result<Manifest, String> {
    let manifest = Manifest::parse(text).map_err(|e| e.to_string())?;
    let results = manifest.results.iter().map(|(name, r)| (name, &r.unit));
    let fields = manifest.fields.iter().map(|f| (&f.name, &f.unit));
    for (name, unit) in results.chain(fields) {
        // Values are handed over in this unit and stored as they are.
        check_si(unit).map_err(|e| format!("its manifest: `{name}`: {e}"))?;
    }
    Ok(manifest)
}

fn full_text(e: &dyn std::error::Error) -> String {
    // libloading keeps the text of dlerror in the source.
    match e.source() {
        Some(source) => source.to_string(),
        None => e.to_string(),
    }
}

fn check_head(head: Head) -> Result<(), String> {
    if head.magic != PF_MAGIC {
        return Err(format!(
            "its descriptor begins with {:#018x} instead of PF_MAGIC {PF_MAGIC:#018x}: \
             `plyflow_plugin` does not return a pf_plugin",
            head.magic
        ));
    }
    if head.abi_major != PF_ABI_MAJOR || head.abi_minor > PF_ABI_MINOR {
        let remedy = if head.abi_major > PF_ABI_MAJOR
            || (head.abi_major == PF_ABI_MAJOR && head.abi_minor > PF_ABI_MINOR)
        {
            "update Plyflow, or build the plugin with this program's plyflow.h or SDK"
        } else {
            "build the plugin again with this program's plyflow.h or SDK"
        };
        return Err(format!(
            "it was built for plugin ABI {}.{}; this program accepts {PF_ABI_MAJOR}.0 to \
             {PF_ABI_MAJOR}.{PF_ABI_MINOR}: {remedy}",
            head.abi_major, head.abi_minor
        ));
    }
    let expected = size_of::<pf_plugin>() as u64;
    if head.size < expected {
        return Err(format!(
            "its descriptor has {} bytes, ABI {PF_ABI_MAJOR}.{PF_ABI_MINOR} has {expected}: set \
             `size` to sizeof(pf_plugin)",
            head.size
        ));
    }
    Ok(())
}

/// No function that the contract demands may be NULL.
fn check_pointers(kind: PluginKind, functions: *const c_void) -> Result<(), String> {
    let names: &[&str] = match kind {
        PluginKind::Step => &["run"],
        PluginKind::Element => &["create", "destroy", "sizes", "initialise", "forces"],
        PluginKind::Material => &["create", "destroy", "sizes", "membrane"],
    };
    for (i, name) in names.iter().enumerate() {
        // Every table is a u64 followed by pointers (checked against plyflow.h in schemas/abi).
        let slot = unsafe { functions.cast::<usize>().add(1 + i).read_unaligned() };
        if slot == 0 {
            return Err(format!("its {kind} function `{name}` is NULL"));
        }
    }
    Ok(())
}
