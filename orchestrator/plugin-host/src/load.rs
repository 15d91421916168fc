//! Loading a plugin library and checking that it keeps the contract of `plyflow.h`.

use crate::breach::{Breach, DESCRIPTOR, LoadError};
use camino::{Utf8Path, Utf8PathBuf};
use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
use plyflow_abi::*;
use plyflow_model::Manifest;
use plyflow_model::manifest::PluginKind;
use plyflow_model::units::check_si;
use std::ffi::c_void;

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

// SAFETY: `functions` is a static table in a library that stays loaded, which nobody writes to (plyflow.h); safe code cannot follow it.
unsafe impl Send for Plugin {}
// SAFETY: as for `Send`.
unsafe impl Sync for Plugin {}

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
        Self::load_bytes(path, None)
    }

    /// As [`Plugin::load`], but only when the bytes of the file are those that the user consented to (BLAKE3, hex); `None`: it lies
    /// where any bytes are trusted.
    ///
    /// # Errors
    /// As [`Plugin::load`], and when the bytes are others.
    pub fn load_bytes(path: &Utf8Path, hash: Option<&str>) -> Result<Self, LoadError> {
        Self::read(path, hash).map_err(|breach| LoadError {
            path: path.into(),
            breach,
        })
    }

    fn read(path: &Utf8Path, hash: Option<&str>) -> Result<Self, Breach> {
        if let Some(wanted) = hash {
            let found = hash_of(path)?;
            if found != wanted {
                let wanted = wanted.to_owned();
                return Err(Breach::OtherBytes { found, wanted });
            }
        }
        if !path.is_file() {
            return Err(Breach::Missing);
        }
        // dlopen searches the system's folders for a name without a slash.
        let full = path.canonicalize_utf8()?;
        // SAFETY: runs the library's initialisers, of which nothing is known: see `load`. The process is there for this library, and may die of it.
        let library = unsafe { Library::open(Some(full.as_std_path()), RTLD_NOW | RTLD_LOCAL) };
        let library = library.map_err(|e| Breach::Loader {
            why: full_text(&e),
            full,
        })?;
        // SAFETY: what is called `plyflow_plugin` has this type in every version of plyflow.h; a library that gives the name to something else
        // breaks a contract that cannot be looked at.
        let entry = unsafe { library.get::<pf_entry>(PF_SYMBOL) };
        // SAFETY: as above; it takes nothing.
        let plugin = entry.map(|entry| unsafe { entry() });
        // Function tables and manifest live in the library.
        std::mem::forget(library);
        let plugin = plugin.map_err(|_| Breach::Foreign)?;
        if plugin.is_null() {
            return Err(Breach::NullDescriptor);
        }
        // SAFETY: not NULL, so a descriptor, whose beginning is the same in every version.
        check_head(unsafe { plugin.cast::<Head>().read_unaligned() })?;
        if !plugin.is_aligned() {
            return Err(Breach::Unaligned);
        }
        // SAFETY: aligned, static (the library stays loaded), and of this version and size, as its head says.
        Self::check(path, unsafe { &*plugin })
    }

    fn check(path: &Utf8Path, d: &'static pf_plugin) -> Result<Self, Breach> {
        // The least size of a table is that of ABI 1.0. What has come since is at the end.
        let step = size_of::<pf_step_functions>();
        let (kind, least, whole) = match d.kind {
            PF_KIND_STEP => (PluginKind::Step, step, step),
            PF_KIND_ELEMENT => {
                let whole = size_of::<pf_element_functions>();
                (PluginKind::Element, pf_element_functions::LEAST, whole)
            }
            PF_KIND_MATERIAL => {
                let whole = size_of::<pf_material_functions>();
                (PluginKind::Material, pf_material_functions::LEAST, whole)
            }
            other => return Err(Breach::Kind(other)),
        };
        if d.functions.is_null() {
            return Err(Breach::NullTable);
        }
        // SAFETY: not NULL, so a table, and every table begins with its size.
        let size = unsafe { d.functions.cast::<u64>().read_unaligned() };
        if size < least as u64 {
            return Err(Breach::TableSize { kind, size, least });
        }
        check_pointers(kind, d.functions)?;
        // SAFETY: a static text of a library that stays loaded.
        let text: &'static str = unsafe { d.manifest.as_str() }.map_err(Breach::ManifestText)?;
        let manifest = read_manifest(text)?;
        if manifest.kind != kind {
            return Err(Breach::Kinds {
                descriptor: kind,
                manifest: manifest.kind,
            });
        }
        Ok(Self {
            path: path.to_owned(),
            manifest,
            manifest_text: text,
            functions: widened(d.functions, size, whole),
        })
    }

    /// The function table of its kind; valid until the process ends.
    #[must_use]
    pub fn functions(&self) -> *const c_void {
        self.functions
    }
}

/// A table with all functions of today: those that one of an earlier minor version does not have are NULL.
fn widened(functions: *const c_void, size: u64, whole: usize) -> *const c_void {
    if size >= whole as u64 {
        return functions;
    }
    // A size and pointers, of eight bytes each.
    let table: &'static mut [u64] = vec![0; whole / size_of::<u64>()].leak();
    // SAFETY: the plugin's table has `size` bytes, as it says, and the new one has more.
    unsafe {
        let from = functions.cast::<u8>();
        from.copy_to_nonoverlapping(table.as_mut_ptr().cast(), size as usize);
    }
    table[0] = whole as u64;
    table.as_ptr().cast()
}

/// BLAKE3 of a file, hex.
pub(crate) fn hash_of(path: &Utf8Path) -> std::io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(std::fs::File::open(path)?)?;
    Ok(hasher.finalize().to_hex().to_string())
}

fn full_text(e: &dyn std::error::Error) -> String {
    // libloading keeps the text of dlerror in the source.
    match e.source() {
        Some(source) => source.to_string(),
        None => e.to_string(),
    }
}

/// Reads a manifest by all of its rules.
pub(crate) fn read_manifest(text: &str) -> Result<Manifest, Breach> {
    let manifest = Manifest::parse(text)?;
    let results = manifest.results.iter().map(|(name, r)| (name, &r.unit));
    let fields = manifest.fields.iter().map(|f| (&f.name, &f.unit));
    for (name, unit) in results.chain(fields) {
        // Values are handed over in this unit and stored as they are.
        check_si(unit).map_err(|e| Breach::Unit {
            name: name.clone(),
            why: e.to_string(),
        })?;
    }
    Ok(manifest)
}

fn check_head(head: Head) -> Result<(), Breach> {
    if head.magic != PF_MAGIC {
        return Err(Breach::Magic(head.magic));
    }
    if head.abi_major != PF_ABI_MAJOR || head.abi_minor > PF_ABI_MINOR {
        return Err(Breach::Abi {
            major: head.abi_major,
            minor: head.abi_minor,
        });
    }
    if head.size < DESCRIPTOR as u64 {
        return Err(Breach::DescriptorSize(head.size));
    }
    Ok(())
}

/// No function that the contract demands may be NULL.
fn check_pointers(kind: PluginKind, functions: *const c_void) -> Result<(), Breach> {
    let names: &[&'static str] = match kind {
        PluginKind::Step => &["run"],
        PluginKind::Element => &["create", "destroy", "sizes", "initialise", "forces"],
        PluginKind::Material => &["create", "destroy", "sizes", "membrane"],
    };
    for (i, name) in names.iter().enumerate() {
        // SAFETY: the table has the size of its kind (`check`), which is a u64 followed by pointers (checked against plyflow.h in schemas/abi), of
        // which these are the first.
        let slot = unsafe { functions.cast::<usize>().add(1 + i).read_unaligned() };
        if slot == 0 {
            return Err(Breach::NullFunction { kind, name });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a plugin of ABI 1.1 was compiled with: the table without its last function. Whoever read beyond its end would find the mark.
    #[repr(C)]
    struct Old {
        table: [u64; 6],
        mark: u64,
    }

    #[test]
    fn a_table_of_an_earlier_minor_version_is_read_no_further_than_its_size() {
        let size = pf_material_functions::LEAST as u64;
        let old = Old {
            table: [size, 11, 12, 13, 14, 15],
            mark: 0xbad,
        };
        let functions: *const c_void = (&raw const old).cast();
        let whole = size_of::<pf_material_functions>();
        let wide = widened(functions, size, whole);
        assert_ne!(wide, functions);
        // SAFETY: a table that `widened` has made: the size and six functions.
        let words = unsafe { std::slice::from_raw_parts(wide.cast::<u64>(), 7) };
        assert_eq!(words, [whole as u64, 11, 12, 13, 14, 15, 0]);
        assert_eq!(old.mark, 0xbad);
        // One of today stays where it is.
        assert_eq!(widened(functions, whole as u64, whole), functions);
    }
}
