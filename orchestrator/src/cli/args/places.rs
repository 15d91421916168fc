//! The words of all commands that read a store.

use camino::Utf8PathBuf;
use clap::Args;

/// Where things are.
#[derive(Debug, Clone, Args, Default)]
pub struct Places {
    /// Folder for artifacts and journals [default: .plyflow beside the workflow]
    #[arg(long, value_name = "DIR")]
    pub store: Option<Utf8PathBuf>,
    /// Look for plugins here first, and trust what lies there; may be repeated
    #[arg(long, value_name = "DIR")]
    pub plugins: Vec<Utf8PathBuf>,
    /// Load libraries that a workflow brings along: all, or the one with this path or BLAKE3; may be repeated
    #[arg(
        long,
        value_name = "LIBRARY",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = ""
    )]
    pub trust: Vec<String>,
}
