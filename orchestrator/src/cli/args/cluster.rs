//! Arguments of the commands about runs on a cluster.

use camino::Utf8PathBuf;
use clap::Args;

/// `status` and `cancel`
#[derive(Debug, Args)]
pub struct ClusterArgs {
    /// A workflow file, or the name of a workflow in the store [default: all of the store]
    pub run: Option<Utf8PathBuf>,
    /// Folder for artifacts and journals [default: .plyflow beside the workflow, or here]
    #[arg(long, value_name = "DIR")]
    pub store: Option<Utf8PathBuf>,
}

/// `pilot`
#[derive(Debug, Args)]
pub struct PilotArgs {
    /// The folder that it shares with the run
    pub folder: Utf8PathBuf,
    /// Its submission
    pub name: String,
    /// Which of the submission it is
    pub index: u32,
}
