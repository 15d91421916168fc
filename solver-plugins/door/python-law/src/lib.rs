//! The carrier of a fabric law in Python.
//!
//! `plyflow.laws` compiles a law with numba, copies this library and appends a payload to the copy: the manifest, the list of parameters, and
//! the object code. The copy is a plugin as any other. It reads its own payload when the host asks for its descriptor, lays the code down in
//! memory, and calls it for every batch. No Python runs. `docs/decisions/0061` says why it is done so.
//!
//! A copy without a payload, which is this library itself, is no plugin: `plyflow_plugin` gives NULL.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod code;
mod functions;
mod law;
mod parameters;
mod payload;

use law::Law;
use plyflow_sdk::abi::*;
use plyflow_sdk::material_table;
use std::ffi::c_char;
use std::sync::OnceLock;

static FUNCTIONS: pf_material_functions = material_table::<Law>();

/// The descriptor, which holds the manifest of the payload; `None` where there is none to be had.
fn descriptor() -> Option<&'static pf_plugin> {
    static DESCRIPTOR: OnceLock<Option<pf_plugin>> = OnceLock::new();
    let made = DESCRIPTOR.get_or_init(|| {
        let manifest = &law::loaded().ok()?.manifest;
        Some(pf_plugin {
            magic: PF_MAGIC,
            abi_major: PF_ABI_MAJOR,
            abi_minor: PF_ABI_MINOR,
            size: size_of::<pf_plugin>() as u64,
            kind: PF_KIND_MATERIAL,
            reserved: 0,
            manifest: text(manifest),
            functions: (&raw const FUNCTIONS).cast(),
        })
    });
    made.as_ref()
}

/// A text that stays where it is until the process ends.
fn text(of: &'static str) -> pf_str {
    pf_str {
        data: of.as_ptr().cast::<c_char>(),
        len: of.len() as u64,
    }
}

/// The plugin's entry point.
#[unsafe(no_mangle)]
pub extern "C" fn plyflow_plugin() -> *const pf_plugin {
    let found = std::panic::catch_unwind(descriptor).unwrap_or(None);
    found.map_or(std::ptr::null(), |descriptor| &raw const *descriptor)
}

/// Why [`plyflow_plugin`] gives NULL; empty where it does not. Whoever makes a law asks, as a host cannot.
#[unsafe(no_mangle)]
pub extern "C" fn plyflow_python_law_fault() -> pf_str {
    match law::loaded() {
        Ok(_) => text(""),
        Err(why) => text(why),
    }
}
