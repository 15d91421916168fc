//! Reading the manifest of a library, in a process that the library may take down with it.

use crate::breach::Breach;
use crate::load::Plugin;
use camino::Utf8Path;
use serde::{Deserialize, Serialize};
use std::io::Write;

/// What is said of a library: one JSON line on the standard output of the describing process.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Description {
    /// A plugin: the text of its manifest.
    Plugin(String),
    /// A library that is no plugin.
    Foreign(String),
    /// A plugin that cannot be used, and why.
    Broken(String),
}

/// Loads a library into this process and describes it; `bytes`: only when its bytes have this BLAKE3 (hex).
#[must_use]
pub fn describe(path: &Utf8Path, bytes: Option<&str>) -> Description {
    match Plugin::load_bytes(path, bytes) {
        Ok(plugin) => Description::Plugin(plugin.manifest_text.to_owned()),
        Err(e) if e.breach == Breach::Foreign => Description::Foreign(e.breach.to_string()),
        Err(e) => Description::Broken(e.breach.to_string()),
    }
}

/// The body of `plyflow step-worker --describe LIBRARY [BLAKE3]`: prints a [`Description`] and returns the exit
/// code (0 when it could be printed).
#[must_use]
pub fn describe_main(path: &Utf8Path, bytes: Option<&str>) -> i32 {
    let mut out = crate::process::private_stdout();
    let line = serde_json::to_string(&describe(path, bytes)).expect("texts are JSON");
    match writeln!(out, "{line}").and_then(|()| out.flush()) {
        Ok(()) => 0,
        Err(_) => 1,
    }
}
