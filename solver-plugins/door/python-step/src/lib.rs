//! A step that is written in Python, as a plugin like any other.
//!
//! `python -m plyflow._plugin FILE` makes a library of a file: a copy of this one, with a [`Payload`] at its end. So whatever looks at plugins
//! (trust, keys, workers, clusters) sees a library with a manifest and bytes of its own, and nothing of it knows of Python. When the step
//! runs, this code starts an interpreter and serves it: one request and one answer at a time, over a socket ([`message`]), each of which is
//! a call of a service of `plyflow.h`. `docs/decisions/0059` says why.
//!
//! Without a payload this is no plugin: `plyflow_plugin` answers NULL.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod child;
mod message;
mod payload;
mod serve;

use payload::Payload;
use plyflow_sdk::abi::*;
use plyflow_sdk::{Host, Step, StepError};
use std::ffi::CStr;
use std::path::PathBuf;
use std::sync::OnceLock;

/// What the library carries, from its first look at itself on.
static CARRIED: OnceLock<Option<Carried>> = OnceLock::new();

struct Carried {
    payload: Payload,
    /// Where the library lies.
    library: PathBuf,
    descriptor: pf_plugin,
}

// SAFETY: the descriptor points to the manifest of the payload beside it, which nobody changes, and to a static table.
unsafe impl Send for Carried {}
// SAFETY: as for `Send`.
unsafe impl Sync for Carried {}

/// The plugin's entry point: the descriptor of the step that this copy carries; NULL when it carries none.
#[unsafe(no_mangle)]
pub extern "C" fn plyflow_plugin() -> *const pf_plugin {
    match CARRIED.get_or_init(look) {
        Some(carried) => &raw const carried.descriptor,
        None => std::ptr::null(),
    }
}

fn look() -> Option<Carried> {
    static FUNCTIONS: pf_step_functions = pf_step_functions {
        size: size_of::<pf_step_functions>() as u64,
        run,
    };
    let library = own_path()?;
    let payload = Payload::of(&library).ok()?;
    // The text does not move when the payload does: a string's bytes lie elsewhere.
    let manifest = pf_str {
        data: payload.manifest.as_ptr().cast(),
        len: payload.manifest.len() as u64,
    };
    let descriptor = pf_plugin {
        magic: PF_MAGIC,
        abi_major: PF_ABI_MAJOR,
        abi_minor: PF_ABI_MINOR,
        size: size_of::<pf_plugin>() as u64,
        kind: PF_KIND_STEP,
        reserved: 0,
        manifest,
        functions: (&raw const FUNCTIONS).cast(),
    };
    Some(Carried {
        payload,
        library,
        descriptor,
    })
}

/// The file from which this code was loaded.
fn own_path() -> Option<PathBuf> {
    use std::os::unix::ffi::OsStrExt;
    // SAFETY: zeros are a struct of this type; `dladdr` fills it, or answers 0.
    let mut info: libc::Dl_info = unsafe { std::mem::zeroed() };
    // SAFETY: the address of a function of this library, and a struct of this function.
    let found = unsafe { libc::dladdr((plyflow_plugin as *const ()).cast(), &raw mut info) };
    if found == 0 || info.dli_fname.is_null() {
        return None;
    }
    // SAFETY: not NULL, so the name of the library, which the loader keeps as long as the library is loaded.
    let name = unsafe { CStr::from_ptr(info.dli_fname) };
    Some(PathBuf::from(std::ffi::OsStr::from_bytes(name.to_bytes())))
}

unsafe extern "C" fn run(services: *const pf_services) -> i32 {
    // SAFETY: the host gives `run` a table that is valid until it returns (plyflow.h).
    unsafe { plyflow_sdk::run_step::<InPython>(services) }
}

/// The step that this library carries.
struct InPython;

impl Step for InPython {
    // The descriptor has that of the payload.
    const MANIFEST: &'static str = "";

    fn run(host: &Host) -> Result<(), StepError> {
        let Some(Some(carried)) = CARRIED.get() else {
            return Err("the library carries no step".into());
        };
        let mut child = child::Child::start(&carried.library)?;
        let end = serve::serve(host, &carried.payload, &mut child.stream);
        child.conclude(end)
    }
}
