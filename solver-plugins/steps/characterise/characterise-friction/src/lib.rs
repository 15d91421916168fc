//! Step plugin `characterise-friction`: Coulomb coefficients from sled tests.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_characterisation::cantilever::mean_and_deviation;
use plyflow_characterisation::confidence::student;
use plyflow_characterisation::csv::{Column, Table, distinct, read};
use plyflow_characterisation::material::significant;
use plyflow_characterisation::output::Output;
use plyflow_characterisation::sled::{Pull, evaluate};
use plyflow_characterisation::{Dimension, GRAVITY};
use plyflow_model::artifact::{Series, Style};
use plyflow_sdk::{Host, Log, Step, StepError, export_step};
use serde::Deserialize;

/// The step.
pub struct CharacteriseFriction;

export_step!(CharacteriseFriction);

#[derive(Deserialize)]
struct Parameters {
    pulls: Vec<String>,
    normal_force: Option<f64>,
    sled_mass: Option<f64>,
    from: f64,
    to: f64,
    pair: String,
}

const COLUMNS: [Column; 2] = [
    Column::required("displacement", Dimension::Length),
    Column::required("force", Dimension::Force),
];

/// Coefficients of fabrics, films and tools: what lies outside is a wrong unit.
const PLAUSIBLE: [f64; 2] = [0.02, 3.0];
/// No sled is pulled farther (m).
const LONGEST_PULL: f64 = 1.0;
/// Parts of the dynamic coefficient that are warned of: of a force before the sled moves, of a drift over the window, of stick-slip.
const AT_REST: f64 = 0.05;
const DRIFT: f64 = 0.1;
const STICK_SLIP: f64 = 0.2;

/// Says what of a pull makes its mean doubtful.
fn warn(host: &Host, source: &str, pull: &Pull, window: [f64; 2]) {
    let mean = pull.dynamic_coefficient;
    let percent = |part: f64| format!("{:.0} %", 100.0 * part.abs() / mean);
    let say = |text: String| host.log(Log::Warn, &format!("{source}: {text}"));
    let [low, high] = PLAUSIBLE;
    if !(low..=high).contains(&mean) {
        say(format!(
            "a coefficient of {} is none that fabrics, films and tools have, {low} to {high}: are [N] of the header and `normal_force` \
             or `sled_mass` in the units of the numbers?",
            significant(mean)
        ));
    }
    if let Some(rest) = pull.at_rest.filter(|r| r.abs() > AT_REST * mean) {
        say(format!(
            "before the sled moves the force is {} of that in the window: an offset of the load cell makes the coefficient wrong by as much; \
             take it off, if it is one",
            percent(rest)
        ));
    }
    if pull.drift.abs() > DRIFT * mean {
        say(format!(
            "the force changes by {} from the first to the last quarter of the window from {:.0} to {:.0} mm: its mean hangs on the window",
            percent(pull.drift),
            1e3 * window[0],
            1e3 * window[1]
        ));
    }
    if pull.scatter > STICK_SLIP * mean {
        say(format!(
            "the force wavers by {} of its mean (standard deviation): the sled sticks and slips, and a coefficient for steady sliding is not what \
             it does",
            percent(pull.scatter)
        ));
    }
}

/// The force (N) that presses the sled down.
fn normal_force(p: &Parameters) -> Result<f64, StepError> {
    match (p.normal_force, p.sled_mass) {
        (Some(force), None) => Ok(force),
        (None, Some(mass)) => Ok(mass * GRAVITY),
        (Some(_), Some(_)) => {
            Err("both `normal_force` and `sled_mass` are given; give one of them".into())
        }
        (None, None) => {
            Err("neither `normal_force` nor `sled_mass` is given; give one of them".into())
        }
    }
}

/// A line for a scene's `friction`: the coefficient with its deviation, from so many pulls, and what is known of the static peak.
fn fragment(pair: &str, pulls: usize, dynamic: [f64; 2], peak: Option<[f64; 2]>) -> String {
    let [mean, deviation] = dynamic.map(significant);
    let peak = peak.map_or_else(String::new, |p| {
        format!("; static peak {}", significant(p[0]))
    });
    format!(
        "# Dynamic coefficient from {pulls} pulls, standard deviation {deviation}{peak}.\n\
         # A fragment: its line goes into `friction:` of a scene.\nfriction:\n  {pair}: {mean}\n"
    )
}

/// Of several pulls their spread; it has what one pull tells of itself in it.
fn error_of(pulls: &[Pull], deviation: f64) -> f64 {
    match pulls {
        [only] => only.error,
        _ => student(pulls.len() - 1) * deviation / (pulls.len() as f64).sqrt(),
    }
}

impl Step for CharacteriseFriction {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let normal = normal_force(&p)?;
        if p.pulls.is_empty() {
            return Err("`pulls` is empty; give at least one CSV file of a pull".into());
        }
        let mut out = Output::default();
        let (mut pulls, mut series) = (Vec::<Pull>::new(), Vec::new());
        let tables = p.pulls.iter().map(|path| read(path, &COLUMNS));
        let tables: Vec<Table> = tables.collect::<Result<_, _>>()?;
        distinct(&tables)?;
        for (i, table) in tables.iter().enumerate() {
            table.plausible_length("displacement", [0.0, LONGEST_PULL], "a sled")?;
            let pull = evaluate(table, [p.from, p.to], normal)?;
            warn(host, &table.source, &pull, [p.from, p.to]);
            pulls.push(pull);
            let [x, y] =
                ["displacement", "coefficient"].map(|n| format!("curves/pull_{}/{n}", i + 1));
            let coefficient: Vec<f64> = table.values("force")?.iter().map(|f| f / normal).collect();
            out.curve(&x, "m", table.values("displacement")?);
            out.curve(&y, "1", &coefficient);
            series.push(Series::new(&table.source, &x, &y).drawn(Style::Line));
        }
        let of = |f: fn(&Pull) -> f64| mean_and_deviation(&pulls.iter().map(f).collect::<Vec<_>>());
        let [dynamic, dynamic_deviation] = of(|p| p.dynamic_coefficient);
        // Of the pulls that were recorded from before the window.
        let peaks: Vec<f64> = pulls.iter().filter_map(|p| p.static_coefficient).collect();
        let peak = (!peaks.is_empty()).then(|| mean_and_deviation(&peaks));
        out.curve("curves/mean/displacement", "m", &[p.from, p.to]);
        out.curve("curves/mean/coefficient", "1", &[dynamic; 2]);
        series.push(
            Series::new(
                "dynamic mean",
                "curves/mean/displacement",
                "curves/mean/coefficient",
            )
            .drawn(Style::Dashed),
        );
        let y = ("force over normal force", "1");
        out.plot(
            "friction",
            "Pulling force over normal force",
            ("displacement", "mm"),
            y,
            series,
        );
        let text = fragment(&p.pair, pulls.len(), [dynamic, dynamic_deviation], peak);
        out.file("friction.yaml", &text);
        out.about.pair = Some(p.pair);
        out.result("dynamic_coefficient", dynamic, "1");
        out.result("dynamic_deviation", dynamic_deviation, "1");
        out.result("dynamic_error", error_of(&pulls, dynamic_deviation), "1");
        if let Some([mean, deviation]) = peak {
            out.result("static_coefficient", mean, "1");
            out.result("static_deviation", deviation, "1");
        }
        out.result("scatter", of(|p| p.scatter)[0], "1");
        out.result("repeats", pulls.len() as f64, "1");
        out.write(host)
    }
}
