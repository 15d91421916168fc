//! The words of the command line.

mod cluster;
mod export;
mod new;
mod places;
mod trust;

pub use cluster::{ClusterArgs, PilotArgs};
pub use export::{ExportArgs, ExportFormat, ExportUnit, Printed};
pub use new::{NewArgs, NewKind, StudyProcess, StudyWords};
pub use places::Places;
pub use trust::TrustArgs;

use crate::exit;
use camino::Utf8PathBuf;
use clap::{Args, Parser, Subcommand, ValueEnum};

/// Runs composite-forming studies that are written as one YAML workflow.
#[derive(Debug, Parser)]
#[command(name = "plyflow", version, after_help = exit::HELP, max_term_width = 110)]
pub struct Cli {
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// What can be asked.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a workflow: what is not yet in the store, and only that
    #[command(after_help = RUN_EXAMPLES)]
    Run(RunArgs),
    /// Show where the steps of a run on a cluster stand
    #[command(
        after_help = "Examples:\n  plyflow status workflow.yaml\n  plyflow status --store /scratch/me/store   # all runs of a store\n\nFrom any machine that sees the store."
    )]
    Status(ClusterArgs),
    /// Stop a run on a cluster; what is finished is kept, and the same run goes on
    #[command(
        after_help = "Examples:\n  plyflow cancel workflow.yaml\n  plyflow cancel my-study --store /scratch/me/store\n\nFrom any machine that sees the store and Slurm, also when the process that drove the run is gone."
    )]
    Cancel(ClusterArgs),
    /// Run steps in an allocation: called by the scripts that a run submits
    #[command(hide = true)]
    Pilot(PilotArgs),
    /// Show what a run would do with each step, and why
    #[command(after_help = PLAN_EXAMPLES)]
    Plan(PlanArgs),
    /// Check the YAML of a workflow and all it names, or of a scene or a material
    #[command(after_help = VALIDATE_EXAMPLES)]
    Validate(ValidateArgs),
    /// Draw the steps and their connections
    #[command(
        after_help = "Examples:\n  plyflow graph workflow.yaml | dot -Tsvg > graph.svg\n  plyflow graph workflow.yaml --format mermaid   # for Markdown"
    )]
    Graph(GraphArgs),
    /// Say why a step would run again: which part of its key changed, from what to what
    #[command(
        after_help = "Examples:\n  plyflow explain workflow.yaml detect\n  plyflow explain workflow.yaml 'local[A]'"
    )]
    Explain(ExplainArgs),
    /// Print the named numbers of the last run, with the values that the workflow expects
    #[command(
        after_help = "Examples:\n  plyflow results workflow.yaml\n  plyflow results workflow.yaml --format csv > results.csv\n  plyflow results workflow.yaml --front --format csv > front.csv   # speed against error, with the Pareto front\n  plyflow results workflow.yaml --check      # exit code 5 when an expectation or a limit is missed"
    )]
    Results(ResultsArgs),
    /// Write the HTML report of what the store has
    Report(ReportArgs),
    /// List the plugins that can be found, or the parameters of one
    #[command(
        after_help = "Examples:\n  plyflow plugins\n  plyflow plugins forming-explicit\n  plyflow plugins --trust ./build/libmine.so"
    )]
    Plugins(PluginsArgs),
    /// Begin a study of a part, or a plugin of your own: a folder that runs at once
    #[command(after_help = new::NEW_EXAMPLES)]
    New(NewArgs),
    /// Keep the list of libraries, besides Plyflow's own, that you let it load
    #[command(after_help = TRUST_EXAMPLES)]
    Trust(TrustArgs),
    /// Judge a plugin against the contract, in a process of its own
    #[command(after_help = CHECK_PLUGIN_EXAMPLES)]
    CheckPlugin(CheckPluginArgs),
    /// Show what an artifact holds
    #[command(
        after_help = "Examples:\n  plyflow inspect result.vtkhdf\n  plyflow inspect 'local[A]' --workflow workflow.yaml"
    )]
    Inspect(InspectArgs),
    /// Write the text files that the artifact of a step carries, such as a material file
    #[command(
        after_help = "Examples:\n  plyflow extract workflow.yaml bending --list\n  plyflow extract workflow.yaml bending --to materials\n  plyflow extract workflow.yaml 'local[A]' --to out --force"
    )]
    Extract(ExtractArgs),
    /// Write formed plies for other programs: VTK, CSV, Abaqus, CalculiX, Nastran, DXF
    #[command(after_help = export::EXPORT_EXAMPLES)]
    Export(ExportArgs),
    /// Print the JSON Schema of a file format, for editors, or its keys in words
    #[command(
        after_help = "Examples:\n  plyflow schema scene --format text               # all keys of a scene, with types, bounds and defaults\n  plyflow schema workflow > workflow.schema.json\n  # first line of a workflow, read by editors:\n  # yaml-language-server: $schema=./workflow.schema.json"
    )]
    Schema(SchemaArgs),
    /// Check a whole store against its seals, or make a step again and compare its bytes
    #[command(
        after_help = "Examples:\n  plyflow verify workflow.yaml\n  plyflow verify workflow.yaml --dry-run       # say it, move nothing\n  plyflow verify workflow.yaml --again zones   # make it again from the same inputs and compare\n\nWhat is damaged is moved to the folder `damaged` of the store, and the next run makes it again. Ends with code 8 when something was."
    )]
    Verify(VerifyArgs),
    /// Say in which numbers two runs, or two artifacts, differ
    #[command(after_help = DIFF_EXAMPLES)]
    Diff(DiffArgs),
    /// Remove artifacts that no workflow's last run uses, or all of a store
    #[command(
        after_help = "Examples:\n  plyflow clean workflow.yaml --dry-run\n  plyflow clean workflow.yaml\n  plyflow clean workflow.yaml --all"
    )]
    Clean(CleanArgs),
    /// Copy the joggle spar into a new folder and run it, to a report
    #[command(
        after_help = "Examples:\n  plyflow demo --coarse          # a minute or two; numbers mean little\n  plyflow demo my-spar           # some minutes, into the folder my-spar\n  plyflow demo --no-run my-spar  # files to begin a study of your own with"
    )]
    Demo(DemoArgs),
    /// Print completions for a shell
    #[command(
        after_help = "Example:\n  plyflow completions bash > ~/.local/share/bash-completion/completions/plyflow"
    )]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

const RUN_EXAMPLES: &str = "\
Examples:
  plyflow run workflow.yaml                    # again: nothing runs
  plyflow run workflow.yaml --jobs 8
  plyflow run workflow.yaml --until zones      # that step and what it needs
  plyflow run workflow.yaml --set detect.over_shear_positive='9 deg'
  plyflow run workflow.yaml --confirm          # and say which defects stay
  plyflow run workflow.yaml --on slurm         # in allocations of a cluster

A run that was stopped or killed resumes with the same command.";

const DIFF_EXAMPLES: &str = "\
Examples:
  plyflow diff workflow.yaml other/workflow.yaml                 # the last runs of both, step by step
  plyflow diff workflow.yaml workflow.yaml --store-b /tmp/store  # the same file, run into two stores
  plyflow diff a.vtkhdf b.vtkhdf --all                           # two artifacts, every difference

Compared are kind, results, attributes, frames, meshes, fields and arrays, to the bit. What made them (plugins, inputs, keys) and what is
measured of the machine (times, memory) are not. Ends with code 9 when something differs.";

const PLAN_EXAMPLES: &str = "\
Examples:
  plyflow plan workflow.yaml
  plyflow plan workflow.yaml --set coarse.element=m4 --format json
  plyflow plan workflow.yaml --confirm=finer,wider               # and what these variants cost";

const VALIDATE_EXAMPLES: &str = "\
Examples:
  plyflow validate workflow.yaml
  plyflow validate workflow.yaml --format json   # for editors
  plyflow validate scene.yaml                    # a scene, or a material, by itself

Found are names, keys, types, units, bounds, wires, missing files, and scenes that make no sense. What only a run finds: what
is in STL and CSV files, curves of materials that make no law, and what depends on the mesh.";

const TRUST_EXAMPLES: &str = "\
Examples:
  plyflow trust ./libmine.so            # these bytes, wherever they lie
  plyflow trust target/release          # a folder that you build into
  plyflow trust                         # show the list
  plyflow trust --forget ./libmine.so

A library can do all that you can do. Plyflow loads its own plugins, those in folders that you name (--plugins, PLYFLOW_PLUGINS), and
those on this list. Any other, such as one in the folder of a workflow, only with --trust or after a question on the terminal.";

const CHECK_PLUGIN_EXAMPLES: &str = "\
Examples:
  plyflow check-plugin ./libmy_element.so               # with a fabric and a film
  plyflow check-plugin ./libmy_element.so --with '{hourglass: 300 N/m}' --material fabric.yaml
  plyflow check-plugin ./libmy_material.so --material my-sheet.yaml
  plyflow check-plugin material-fabric --material my-fabric.yaml --format json

To name a library here is to consent that it is loaded. A crash, an exit or a hang of the plugin is a finding as any other. Ends with code 7 when a check failed.";

/// A workflow and where things are.
#[derive(Debug, Args)]
pub struct Workflow {
    /// The workflow file
    pub workflow: Utf8PathBuf,
    #[command(flatten)]
    /// Where things are.
    pub places: Places,
    /// Use another value for a parameter, written as in YAML; may be repeated
    #[arg(long = "set", value_name = "STEP.PARAMETER=VALUE")]
    pub set: Vec<String>,
    /// Also run the zones in other ways, and say which defects stay: in all ways, or in some of finer, slower, half_step, wider
    #[arg(
        long,
        value_name = "VARIANTS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "all"
    )]
    pub confirm: Option<String>,
}

/// `run`
#[derive(Debug, Args)]
pub struct RunArgs {
    #[command(flatten)]
    /// The workflow.
    pub workflow: Workflow,
    /// Cores that the steps share [default: all of this machine]
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub jobs: Option<u32>,
    /// Run the steps in allocations of a cluster: `slurm`, or a profile file
    #[arg(long, value_name = "slurm|PROFILE", conflicts_with_all = ["jobs", "memory"])]
    pub on: Option<Utf8PathBuf>,
    /// Memory that the steps share, for steps that state theirs: 8GiB [default: nine tenths of this machine]
    #[arg(long, value_name = "SIZE")]
    pub memory: Option<String>,
    /// After a failure finish what does not depend on it
    #[arg(long, conflicts_with = "fail_fast")]
    pub keep_going: bool,
    /// After a failure stop everything
    #[arg(long)]
    pub fail_fast: bool,
    /// Run only this step and what it needs; may be repeated
    #[arg(long, value_name = "STEP")]
    pub until: Vec<String>,
    /// Run this step again even if the store has it; may be repeated
    #[arg(long, value_name = "STEP")]
    pub force: Vec<String>,
    /// How long a running step may go without a checkpoint, if it makes any
    #[arg(long, value_name = "TIME", default_value = "1 min")]
    pub checkpoint_every: String,
    /// Show nothing but failures
    #[arg(long, short)]
    pub quiet: bool,
    /// How events are shown
    #[arg(long, value_enum, default_value = "text")]
    pub log_format: LogFormat,
    /// Do not write the HTML report
    #[arg(long)]
    pub no_report: bool,
    /// End with code 5 when an expectation or a limit is missed
    #[arg(long)]
    pub check: bool,
}

/// How events are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Bars on a terminal, lines elsewhere
    Text,
    /// One JSON object a line, on standard error
    Json,
}

/// Form of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people
    Table,
    /// For programs
    Json,
    /// For spreadsheets
    Csv,
}

/// Form of an answer that has no CSV.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TextOrJson {
    /// For people
    Text,
    /// For programs
    Json,
}

/// `plan`
#[derive(Debug, Args)]
pub struct PlanArgs {
    #[command(flatten)]
    /// The workflow.
    pub workflow: Workflow,
    /// Also show the allocations that a run on a cluster asks for: `slurm`, or a profile file
    #[arg(long, value_name = "slurm|PROFILE")]
    pub on: Option<Utf8PathBuf>,
    /// Only this step and what it needs; may be repeated
    #[arg(long, value_name = "STEP")]
    pub until: Vec<String>,
    /// Form
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// `validate`
#[derive(Debug, Args)]
pub struct ValidateArgs {
    #[command(flatten)]
    /// The workflow.
    pub workflow: Workflow,
    /// Form
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// `graph`
#[derive(Debug, Args)]
pub struct GraphArgs {
    #[command(flatten)]
    /// The workflow.
    pub workflow: Workflow,
    /// Form
    #[arg(long, value_enum, default_value = "dot")]
    pub format: GraphFormat,
}

/// Form of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum GraphFormat {
    /// Graphviz
    Dot,
    /// Mermaid
    Mermaid,
}

/// `explain`
#[derive(Debug, Args)]
pub struct ExplainArgs {
    #[command(flatten)]
    /// The workflow.
    pub workflow: Workflow,
    /// A step, or one of its items: local[A]
    pub step: String,
    /// Form
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// `demo`
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// The folder to make: nothing that is there is overwritten
    #[arg(default_value = "plyflow-demo")]
    pub folder: Utf8PathBuf,
    /// The variant with large elements, to try things out
    #[arg(long)]
    pub coarse: bool,
    /// Cores that the steps share [default: all of this machine]
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub jobs: Option<u32>,
    /// Only copy the files
    #[arg(long, conflicts_with = "jobs")]
    pub no_run: bool,
}

/// `results`
#[derive(Debug, Args)]
pub struct ResultsArgs {
    #[command(flatten)]
    /// The workflow.
    pub workflow: Workflow,
    /// Form
    #[arg(long, value_enum, default_value = "table")]
    pub format: Format,
    /// Only this step; may be repeated
    #[arg(long, value_name = "STEP")]
    pub step: Vec<String>,
    /// Instead: the table of the study, a row for each of its points
    #[arg(long, conflicts_with_all = ["front", "step"])]
    pub study: bool,
    /// Instead: what every way that a comparison measured costs, how wrong it is, and whether it is on the Pareto front
    #[arg(long, conflicts_with = "check")]
    pub front: bool,
    /// End with code 5 when an expectation or a limit is missed
    #[arg(long)]
    pub check: bool,
}

/// `report`
#[derive(Debug, Args)]
pub struct ReportArgs {
    #[command(flatten)]
    /// The workflow.
    pub workflow: Workflow,
    /// Where to write it [default: report.html beside the workflow]
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<Utf8PathBuf>,
    /// Of a study: write the page of this point, by its name, into a folder beside the study's page; may be repeated
    #[arg(long, value_name = "NAME")]
    pub point: Vec<String>,
    /// Write a page of two runs side by side: this one, and that of another workflow file (or of the same with `--beside-set`)
    #[arg(long, value_name = "FILE", conflicts_with = "point")]
    pub beside: Option<Utf8PathBuf>,
    /// As `--set`, for the workflow of `--beside`; may be repeated
    #[arg(long, value_name = "STEP.P=VALUE", requires = "beside")]
    pub beside_set: Vec<String>,
}

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

/// `inspect`
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// An artifact file, or with --workflow a step or one of its items: local[A]
    pub artifact: String,
    /// The workflow whose step is meant
    #[arg(long, value_name = "FILE")]
    pub workflow: Option<Utf8PathBuf>,
    #[command(flatten)]
    /// Where things are.
    pub places: Places,
    /// Form
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// `extract`
#[derive(Debug, Args)]
pub struct ExtractArgs {
    #[command(flatten)]
    /// The workflow.
    pub workflow: Workflow,
    /// A step, or one of its items: local[A]
    pub step: String,
    /// Folder to write into, made if need be [default: the current one]
    #[arg(long, value_name = "DIR")]
    pub to: Option<Utf8PathBuf>,
    /// Only list the files
    #[arg(long, short)]
    pub list: bool,
    /// Replace files that are there with another content
    #[arg(long, conflicts_with = "list")]
    pub force: bool,
}

/// `schema`
#[derive(Debug, Args)]
pub struct SchemaArgs {
    /// Which
    #[arg(value_enum, default_value = "workflow")]
    pub which: SchemaKind,
    /// Form: a JSON Schema, or the keys in words
    #[arg(long, value_enum, default_value = "json")]
    pub format: TextOrJson,
    #[command(flatten)]
    /// Where things are.
    pub places: Places,
}

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SchemaKind {
    /// Workflows, with the parameters of the plugins that are found
    Workflow,
    /// Workflows, without plugins: the same on every machine
    PlainWorkflow,
    /// Scenes
    Scene,
    /// Materials
    Material,
    /// Files of expectations
    Expected,
    /// Profiles of clusters, for `--on`
    Profile,
    /// Attributes of artifacts, by kind
    Artifacts,
}

/// `verify`
#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// The workflow beside whose file the store lies
    pub workflow: Option<Utf8PathBuf>,
    #[command(flatten)]
    /// Where things are.
    pub places: Places,
    /// Use another value for a parameter, written as in YAML; may be repeated (with --again)
    #[arg(long = "set", value_name = "STEP.PARAMETER=VALUE", requires = "again")]
    pub set: Vec<String>,
    /// Instead: make this step again, from the inputs that the store has, and compare its artifact byte by byte; may be repeated
    #[arg(long, value_name = "STEP", requires = "workflow")]
    pub again: Vec<String>,
    /// Cores to use with --again [default: all]
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), requires = "again")]
    pub jobs: Option<u32>,
    /// Say what is damaged, move nothing
    #[arg(long, short = 'n', conflicts_with = "again")]
    pub dry_run: bool,
    /// Form
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// `diff`
#[derive(Debug, Args)]
pub struct DiffArgs {
    /// A workflow file, or an artifact
    pub a: Utf8PathBuf,
    /// What it is held against: another one, or the same file with another store
    pub b: Utf8PathBuf,
    /// Only this step; may be repeated
    #[arg(long = "step", value_name = "STEP")]
    pub steps: Vec<String>,
    /// Store of the first workflow [default: .plyflow beside it]
    #[arg(long, value_name = "DIR")]
    pub store_a: Option<Utf8PathBuf>,
    /// Store of the second workflow [default: .plyflow beside it]
    #[arg(long, value_name = "DIR")]
    pub store_b: Option<Utf8PathBuf>,
    /// Look for plugins here first, and trust what lies there; may be repeated
    #[arg(long, value_name = "DIR")]
    pub plugins: Vec<Utf8PathBuf>,
    /// Load libraries that a workflow brings along: all, or the one with this path or BLAKE3; may be repeated
    #[arg(long, value_name = "LIBRARY", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    pub trust: Vec<String>,
    /// Show all differences of a step, not only the first twenty
    #[arg(long)]
    pub all: bool,
    /// Form
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// `clean`
#[derive(Debug, Args)]
pub struct CleanArgs {
    /// The workflow beside whose file the store lies
    pub workflow: Option<Utf8PathBuf>,
    #[command(flatten)]
    /// Where things are.
    pub places: Places,
    /// Remove the whole store: artifacts, journals, logs
    #[arg(long)]
    pub all: bool,
    /// Say what would go, remove nothing
    #[arg(long, short = 'n')]
    pub dry_run: bool,
}
