//! The command line: what can be asked, and what each command answers.

mod args;
mod check_plugin;
mod clean;
mod cluster;
mod confirm;
mod deliver;
mod demo;
mod diff;
mod explain;
mod export;
mod extract;
mod found;
mod front;
mod inspect;
mod keys;
mod machine;
mod new;
mod on;
mod open;
mod plan;
mod plugins;
mod python;
mod report;
mod results;
mod run;
mod shipped;
mod study;
mod study_file;
mod study_plan;
mod study_report;
mod table;
mod trust;
mod typed;
mod verify;

pub use args::Cli;

use crate::advice;
use crate::exit;
use crate::said::{Done, warn};
use args::{Command, LogFormat};
use clap::{CommandFactory, Parser};
use plyflow_model::text::steers;
use serde_json::json;

/// Tells help, or what is wrong with the command line: in colours, unless a word of it (the name of a stranger's file, say) could steer the
/// terminal.
fn tell_usage(e: &clap::Error) {
    let steered = |word: std::ffi::OsString| word.to_string_lossy().chars().any(steers);
    if std::env::args_os().any(steered) {
        warn(&e.to_string());
    } else {
        let _ = e.print();
    }
}

/// Runs the command line of this process and returns the exit code.
pub fn main() -> u8 {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) => {
            tell_usage(&e);
            return if e.use_stderr() {
                exit::USAGE
            } else {
                exit::OK
            };
        }
    };
    plyflow_plugin_host::Orphans::adopt();
    let json = speaks_json(&cli.command);
    match dispatch(cli.command) {
        Ok(()) => exit::OK,
        Err(stop) => {
            if !stop.text.is_empty() {
                let text = advice::with(&stop.text);
                warn(&match json {
                    true => format!(
                        "{}\n",
                        json!({"event": "error", "code": stop.code, "text": text})
                    ),
                    false => format!("plyflow: {text}\n"),
                });
            }
            stop.code
        }
    }
}

/// Whether all that a command says on standard error is JSON.
fn speaks_json(command: &Command) -> bool {
    matches!(command, Command::Run(a) if a.log_format == LogFormat::Json)
}

fn dispatch(command: Command) -> Done {
    match command {
        Command::Run(a) => run::run(&a),
        Command::Status(a) => cluster::status(&a),
        Command::Cancel(a) => cluster::cancel(&a),
        Command::Pilot(a) => cluster::pilot(&a),
        Command::Plan(a) => plan::plan(&a),
        Command::Validate(a) => plan::validate(&a),
        Command::Graph(a) => plan::graph(&a),
        Command::Explain(a) => explain::explain(&a),
        Command::Results(a) => results::results(&a),
        Command::Report(a) => report::report(&a),
        Command::Plugins(a) => plugins::plugins(&a),
        Command::New(a) => new::new(&a),
        Command::Trust(a) => trust::command(&a),
        Command::CheckPlugin(a) => check_plugin::check_plugin(&a),
        Command::Inspect(a) => inspect::inspect(&a),
        Command::Extract(a) => extract::extract(&a),
        Command::Export(a) => export::export(&a),
        Command::Schema(a) => plugins::schema(&a),
        Command::Verify(a) => verify::verify(&a),
        Command::Diff(a) => diff::diff(&a),
        Command::Clean(a) => clean::clean(&a),
        Command::Demo(a) => demo::demo(&a),
        Command::Completions { shell } => {
            let mut command = Cli::command();
            clap_complete::generate(shell, &mut command, "plyflow", &mut std::io::stdout());
            Ok(())
        }
    }
}
