//! Arguments of `trust`.

use camino::Utf8PathBuf;
use clap::Args;

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
