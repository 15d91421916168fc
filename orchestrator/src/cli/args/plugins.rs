//! Arguments of the commands about plugins.

use super::{Places, TextOrJson};
use camino::Utf8PathBuf;
use clap::Args;

/// `plugins`
#[derive(Debug, Args)]
pub struct PluginsArgs {
    /// A plugin by name or path: show its parameters, inputs and results
    pub name: Option<String>,
    /// Also look where this workflow says
    #[arg(long, value_name = "FILE")]
    pub workflow: Option<Utf8PathBuf>,
    #[command(flatten)]
    /// Where things are.
    pub places: Places,
    /// Form
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
    /// Write the manifest of the named plugin into a file beside its library, so that others can read it without loading it
    #[arg(long, requires = "name")]
    pub write_manifest: bool,
}

/// `trust`
#[derive(Debug, Args)]
pub struct TrustArgs {
    /// Libraries (their bytes as they are now) or folders (whatever will lie there) [default: show the list]
    #[arg(value_name = "LIBRARY|DIR|BLAKE3")]
    pub paths: Vec<Utf8PathBuf>,
    /// Take them out of the list
    #[arg(long, requires = "paths")]
    pub forget: bool,
}

/// `check-plugin`
#[derive(Debug, Args)]
pub struct CheckPluginArgs {
    /// The plugin: path of a library, or name on the search path
    #[arg(value_name = "LIBRARY")]
    pub plugin: String,
    /// A material file: what an element is judged with, or the sheet of the material plugin that is judged; may be
    /// repeated [default for elements: a fabric with stitches and a film]
    #[arg(long, value_name = "FILE")]
    pub material: Vec<Utf8PathBuf>,
    /// The plugin's parameters, as under `with:` in a workflow: YAML or JSON, or a file of it
    #[arg(long, value_name = "PARAMETERS")]
    pub with: Option<String>,
    /// Look for plugins here first; may be repeated
    #[arg(long, value_name = "DIR")]
    pub plugins: Vec<Utf8PathBuf>,
    /// Also load libraries that a material file names
    #[arg(long)]
    pub trust: bool,
    /// Seconds after which a plugin counts as hanging
    #[arg(long, value_name = "SECONDS", default_value = "120")]
    pub time_limit: f64,
    /// Form
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}
