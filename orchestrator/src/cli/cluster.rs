//! `status`, `cancel` and `pilot`: runs on a cluster, from wherever the store can be seen.

use super::args::{ClusterArgs, PilotArgs, Places};
use super::open::store_root;
use super::run::interrupts::Interrupts;
use crate::cluster::{Exchange, Row, Slurm, Standing, Submission, driven_by, pilot};
use crate::exit;
use crate::said::{Done, Stop, print};
use crate::store::Store;
use camino::Utf8PathBuf;

/// The runs that are meant, by their names, which have ever been on a cluster.
fn meant(args: &ClusterArgs) -> Result<Vec<(String, Exchange)>, Stop> {
    let file = args.run.as_deref().filter(|f| f.is_file());
    let places = Places {
        store: args.store.clone(),
        ..Places::default()
    };
    let store = Store::new(store_root(&places, file));
    let read = |e| Stop::machine(format!("reading the store {}", store.root()))(e);
    let runs = match (&args.run, file.and_then(plyflow_workflow::name_of)) {
        (None, _) => store.runs().map_err(read)?,
        (Some(_), Some(name)) => vec![store.run(&name)],
        (Some(given), None) => vec![store.run(given.as_str())],
    };
    let one = |root: Utf8PathBuf| {
        (
            root.file_name().unwrap_or_default().to_owned(),
            Exchange::new(&root),
        )
    };
    let mut found: Vec<_> = runs.into_iter().map(|r| one(r.root)).collect();
    found.retain(|(_, exchange)| exchange.exists());
    if let (Some(given), true) = (&args.run, found.is_empty()) {
        let text = format!(
            "'{given}' is no workflow that has run on a cluster with the store {}; give its file or its name, and --store",
            store.root()
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    Ok(found)
}

/// What Slurm says of all that is not settled; or why it says nothing.
fn rows(submissions: &[Submission]) -> Result<Vec<Row>, String> {
    let names: Vec<String> = submissions.iter().map(|s| s.intent.name.clone()).collect();
    match names.is_empty() {
        true => Ok(Vec::new()),
        false => Slurm::default().look(&names),
    }
}

fn open_submissions(exchange: &Exchange) -> Vec<Submission> {
    let names = exchange.submissions().into_iter();
    let mut found: Vec<Submission> = names
        .filter_map(|n| Submission::found(exchange, &n))
        .collect();
    for submission in &mut found {
        submission.listen();
    }
    found
}

/// `plyflow status`.
///
/// # Errors
/// When the run is none of the store.
pub fn status(args: &ClusterArgs) -> Done {
    let runs = meant(args)?;
    if runs.is_empty() {
        return print("no run of this store has been on a cluster\n");
    }
    let texts = runs.iter().map(|(name, exchange)| of_run(name, exchange));
    print(&texts.collect::<String>())
}

/// Where a run stands, in words.
fn of_run(name: &str, exchange: &Exchange) -> String {
    let told = exchange.told();
    let (mut waiting, mut running) = (0, 0);
    for shape in exchange.shapes() {
        for (attempt, standing) in exchange.standing(&shape) {
            match standing {
                Standing::Waits => waiting += 1,
                Standing::Taken(_) if !told.contains(&attempt) => running += 1,
                Standing::Taken(_) => {}
            }
        }
    }
    let head = match driven_by(exchange) {
        Some((host, process)) => format!("driven by process {process} on {host}"),
        None => "not driven by a `plyflow run` now".into(),
    };
    let mut text = format!(
        "{name}: {waiting} steps wait, {running} run or ran last, {} have ended; {head}\n",
        told.len()
    );
    let submissions = open_submissions(exchange);
    let rows = rows(&submissions);
    if let Err(why) = &rows {
        text += &format!("  Slurm does not answer: {why}\n");
    }
    for submission in &submissions {
        for (index, pilot) in submission.pilots.iter().enumerate() {
            let of = |r: &&Row| r.name == submission.intent.name && r.index as usize == index;
            let state = match rows.as_ref().map(|rows| rows.iter().find(of)) {
                Ok(Some(row)) => format!("{} {} {}", row.state, row.reason, row.nodes),
                Ok(None) => "not known to Slurm".into(),
                Err(_) => "unknown".into(),
            };
            let job = submission.job.as_deref().unwrap_or("?");
            text += &format!(
                "  {} (job {job}): {}; {}\n",
                pilot.name,
                state.trim(),
                submission.intent.shape.text()
            );
            let Some(beat) = &pilot.beat else { continue };
            let over = beat
                .over
                .as_ref()
                .map_or(String::new(), |why| format!("; it ends, as {why}"));
            text += &format!("    on {}: {} steps ended{over}\n", beat.host, beat.ended);
            for (attempt, progress) in &beat.running {
                text += &format!(
                    "    {attempt} {:.0} % {}\n",
                    progress.fraction * 100.0,
                    progress.phase
                );
            }
        }
    }
    text
}

/// `plyflow cancel`.
///
/// # Errors
/// When the run is none of the store, or Slurm does not answer.
pub fn cancel(args: &ClusterArgs) -> Done {
    let runs = meant(args)?;
    if args.run.is_none() && runs.len() > 1 {
        let names: Vec<&str> = runs.iter().map(|(n, _)| n.as_str()).collect();
        return Err(Stop::new(
            exit::USAGE,
            format!("which run? This store has {}", names.join(", ")),
        ));
    }
    for (name, exchange) in &runs {
        let machine = || Stop::machine(format!("cancelling '{name}'"));
        std::fs::write(exchange.stop(), "").map_err(machine())?;
        let (mut waiting, mut running) = (0, 0);
        for shape in exchange.shapes() {
            for (attempt, standing) in exchange.standing(&shape) {
                match standing {
                    Standing::Waits if driven_by(exchange).is_some() => waiting += 1,
                    Standing::Waits => waiting += usize::from(exchange.withdraw(&shape, &attempt)),
                    Standing::Taken(_) if exchange.verdict(&attempt).is_none() => {
                        exchange.ask_to_stop(&attempt).map_err(machine())?;
                        running += 1;
                    }
                    Standing::Taken(_) => {}
                }
            }
        }
        let submissions = open_submissions(exchange);
        for submission in &submissions {
            submission.ask_to_end();
        }
        let waits = |s: &&Submission| s.pilots.iter().any(|p| p.beat.is_none());
        let jobs: Vec<String> = submissions
            .iter()
            .filter(waits)
            .filter_map(|s| s.job.clone())
            .collect();
        let taken = Slurm::default().cancel(&jobs, false);
        print(&format!(
            "{name}: {running} running steps are asked to write checkpoints and stop, {waiting} that wait are not begun; allocations end by themselves\n"
        ))?;
        taken.map_err(|why| {
            let text = format!("Slurm does not answer ({why}): allocations that wait in its queue stay there until they begin, and end then at once");
            Stop::new(exit::INTERNAL, text)
        })?;
    }
    Ok(())
}

/// `plyflow pilot`.
///
/// # Errors
/// When the allocation cannot begin.
pub fn pilot(args: &PilotArgs) -> Done {
    let machine = || Stop::machine(format!("the allocation {}", args.name));
    let interrupts = Interrupts::listen().map_err(machine())?;
    let wake = interrupts.poll_end().map_err(machine())?;
    let exchange = Exchange::at(args.folder.clone());
    pilot::run(&exchange, &args.name, args.index, wake, &|| {
        interrupts.count()
    })
    .map_err(|e| Stop::new(exit::INTERNAL, e))
}
