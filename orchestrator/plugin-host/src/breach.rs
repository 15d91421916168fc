//! Why a library is no plugin that this program can use.

use camino::Utf8PathBuf;
use plyflow_abi::*;
use plyflow_model::manifest::{ManifestError, PluginKind};
use std::io;

/// Bytes of a descriptor.
pub(crate) const DESCRIPTOR: usize = size_of::<pf_plugin>();

/// Why a library is not a plugin that this program can use.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {breach}")]
pub struct LoadError {
    /// The library.
    pub path: Utf8PathBuf,
    /// What was found, what is expected, what to do.
    pub breach: Breach,
}

/// What a library breaks of the contract of `plyflow.h`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Breach {
    /// It is not there.
    #[error("there is no such file")]
    Missing,
    /// The file system refuses.
    #[error("{0}")]
    Unreadable(String),
    /// It has changed since the user consented to it.
    #[error(
        "it is not the library that was consented to: its blake3 is {found}, expected {wanted}. It has \
         changed since this command began; run it again"
    )]
    OtherBytes {
        /// BLAKE3 of its bytes, hex.
        found: String,
        /// That of the bytes that may be loaded.
        wanted: String,
    },
    /// The system's loader refuses.
    #[error(
        "the library cannot be loaded: {why}. Check that it was built for this \
         machine and that the libraries it needs are installed (`ldd {full}`)"
    )]
    Loader {
        /// In the loader's words.
        why: String,
        /// The path without links.
        full: Utf8PathBuf,
    },
    /// It loads but is no Plyflow plugin at all.
    #[error(
        "it is not a Plyflow plugin: it does not export `plyflow_plugin`. A plugin written \
         with the SDK ends with `export_step!`, `export_element!` or `export_material!`"
    )]
    Foreign,
    /// No descriptor.
    #[error("`plyflow_plugin()` returned NULL instead of a descriptor")]
    NullDescriptor,
    /// A descriptor where none can stand.
    #[error("`plyflow_plugin()` returned a descriptor that is not aligned as a pf_plugin")]
    Unaligned,
    /// Something else than a descriptor.
    #[error(
        "its descriptor begins with {0:#018x} instead of PF_MAGIC {PF_MAGIC:#018x}: \
         `plyflow_plugin` does not return a pf_plugin"
    )]
    Magic(u64),
    /// Another ABI.
    #[error(
        "it was built for plugin ABI {major}.{minor}; this program accepts {PF_ABI_MAJOR}.0 to \
         {PF_ABI_MAJOR}.{PF_ABI_MINOR}: {}",
        abi_remedy(*major, *minor)
    )]
    Abi {
        /// Major version.
        major: u32,
        /// Minor version.
        minor: u32,
    },
    /// A descriptor that is too small.
    #[error(
        "its descriptor has {0} bytes, ABI {PF_ABI_MAJOR}.{PF_ABI_MINOR} has {DESCRIPTOR}: set \
         `size` to sizeof(pf_plugin)"
    )]
    DescriptorSize(u64),
    /// No kind that there is.
    #[error(
        "its kind is {0}; expected {PF_KIND_STEP} (step), {PF_KIND_ELEMENT} \
         (element) or {PF_KIND_MATERIAL} (material)"
    )]
    Kind(u32),
    /// No functions.
    #[error("its function table is NULL")]
    NullTable,
    /// A function table that is too small.
    #[error(
        "its {kind} function table has {size} bytes; ABI {PF_ABI_MAJOR}.{PF_ABI_MINOR} \
         expects at least {least}. Set `size` to the size of the table"
    )]
    TableSize {
        /// Kind.
        kind: PluginKind,
        /// Bytes that it says it has.
        size: u64,
        /// Bytes that it must have.
        least: usize,
    },
    /// A function that the contract demands is not there.
    #[error("its {kind} function `{name}` is NULL")]
    NullFunction {
        /// Kind.
        kind: PluginKind,
        /// The function.
        name: &'static str,
    },
    /// The manifest is no text.
    #[error("its manifest is not UTF-8: {0}")]
    ManifestText(std::str::Utf8Error),
    /// The manifest is wrong.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// A unit of the manifest is not of SI: values are handed over in it and stored as they are.
    #[error("its manifest: `{name}`: {why}")]
    Unit {
        /// The result or field.
        name: String,
        /// What is wrong with its unit.
        why: String,
    },
    /// Descriptor and manifest disagree.
    #[error("its descriptor says {descriptor}, its manifest says {manifest}; they must agree")]
    Kinds {
        /// Kind by the descriptor.
        descriptor: PluginKind,
        /// Kind by the manifest.
        manifest: PluginKind,
    },
}

impl From<io::Error> for Breach {
    fn from(e: io::Error) -> Self {
        Self::Unreadable(e.to_string())
    }
}

fn abi_remedy(major: u32, minor: u32) -> &'static str {
    if major > PF_ABI_MAJOR || (major == PF_ABI_MAJOR && minor > PF_ABI_MINOR) {
        "update Plyflow, or build the plugin with this program's plyflow.h or SDK"
    } else {
        "build the plugin again with this program's plyflow.h or SDK"
    }
}

/// Why a component that a plugin asks for is not handed over.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ComponentError {
    /// Its library is no plugin.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A path that nobody has consented to.
    #[error(
        "the {kind} {name} lies in no folder that is trusted, and no parameter of type `{kind}` names it: \
         it is not loaded"
    )]
    NotTrusted { kind: PluginKind, name: String },
    /// The library is of another kind.
    #[error("{name} is of kind {found}, not {kind}")]
    OtherKind {
        name: String,
        found: PluginKind,
        kind: PluginKind,
    },
    /// All libraries whose names fit are broken.
    #[error("{}", joined(.0, "; "))]
    Broken(Vec<LoadError>),
    /// No library on the search path is it.
    #[error(
        "there is no {kind} '{name}'; searched: {}",
        if .searched.is_empty() { "no folder".into() } else { joined(.searched, ", ") }
    )]
    NotFound {
        kind: PluginKind,
        name: String,
        searched: Vec<Utf8PathBuf>,
    },
}

fn joined<T: ToString>(all: &[T], by: &str) -> String {
    let all: Vec<String> = all.iter().map(T::to_string).collect();
    all.join(by)
}
