//! Step plugin `characterise-cantilever`: constant bending stiffness from a standard cantilever test.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_characterisation::GRAVITY;
use plyflow_characterisation::cantilever::{
    Formula, PLAUSIBLE_OVERHANG, STANDARD_ANGLE, implausible_bending_length, implausible_stiffness,
    mean_and_deviation, stiffness,
};
use plyflow_characterisation::confidence::student;
use plyflow_characterisation::csv::{Column, Table, read};
use plyflow_characterisation::material::{self, Template, quantity, significant};
use plyflow_characterisation::output::Output;
use plyflow_fixed::FixedBits;
use plyflow_model::artifact::{Series, Style};
use plyflow_sdk::{Host, Log, Step, StepError, export_step};
use serde::Deserialize;
use serde_json::json;

/// The step.
pub struct CharacteriseCantilever;

export_step!(CharacteriseCantilever);

#[derive(Deserialize)]
struct Parameters {
    overhangs: String,
    angle: Option<f64>,
    formula: Formula,
    areal_mass: Option<f64>,
    bending: String,
    template: Option<String>,
}

const COLUMNS: [Column; 2] = [
    Column::required("overhang", plyflow_characterisation::Dimension::Length),
    Column::optional("angle", plyflow_characterisation::Dimension::Angle),
];

/// Specimens whose stiffnesses differ by more than this part (standard deviation) are not of one kind.
const SCATTER: f64 = 0.3;

/// Says what makes the mean doubtful.
fn warn(host: &Host, weight: f64, mean: f64, deviation: f64) {
    let doubts = [
        implausible_stiffness(mean),
        implausible_bending_length((mean / weight).fixed_cbrt()),
        material::implausible_areal_mass(weight / GRAVITY),
    ];
    for text in doubts.into_iter().flatten() {
        host.log(Log::Warn, &text);
    }
    if deviation > SCATTER * mean {
        let text = format!(
            "the stiffnesses of the specimens differ by {:.0} % (standard deviation): are all of one fabric, direction and face, and is each overhang that \
             of its angle? Their mean is none of them",
            100.0 * deviation / mean
        );
        host.log(Log::Warn, &text);
    }
}

/// The angle (rad) of the specimens that have none of their own.
fn angle(p: &Parameters, table: &Table) -> Result<f64, StepError> {
    match (p.angle, p.formula) {
        (Some(angle), _) => Ok(angle),
        (None, Formula::Standard) => Ok(STANDARD_ANGLE),
        (None, Formula::Peirce) if table.column("angle").is_some() => Ok(STANDARD_ANGLE),
        (None, Formula::Peirce) => {
            Err(format!(
                "{}: the angle of the secant is not told, and 'peirce' hangs on it (the stiffness at 7.1 deg is 7.6 times that of the same \
                 overhang at 41.5 deg); give a column `angle [deg]` or the parameter `angle`",
                table.source
            )
            .into())
        }
    }
}

/// The stiffness of each specimen, and their mean.
fn plot(out: &mut Output) {
    let number = "curves/specimens/number";
    out.plot(
        "stiffness",
        "Bending stiffness by specimen",
        ("specimen", "1"),
        ("bending stiffness", "N mm"),
        vec![
            Series::new("measured", number, "curves/specimens/stiffness").drawn(Style::Points),
            Series::new("mean", number, "curves/specimens/mean").drawn(Style::Dashed),
        ],
    );
}

impl Step for CharacteriseCantilever {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let template = Template::of(host, p.template.as_deref())?;
        let weight = GRAVITY * material::areal_mass(p.areal_mass, template.as_ref())?;
        let table = read(&p.overhangs, &COLUMNS)?;
        table.at_least(1, "a stiffness")?;
        let overhangs = table.values("overhang")?;
        let given = angle(&p, &table)?;
        let mut stiffnesses = Vec::new();
        for (i, overhang) in overhangs.iter().enumerate() {
            let angle = table.column("angle").map_or(given, |a| a[i]);
            let b = stiffness(p.formula, *overhang, angle, weight);
            stiffnesses.push(b.map_err(|e| format!("{}: {e}", table.place(i)))?);
        }
        table.plausible_length("overhang", PLAUSIBLE_OVERHANG, "a strip of fabric")?;
        let [mean, deviation] = mean_and_deviation(&stiffnesses);
        let n = stiffnesses.len();
        warn(host, weight, mean, deviation);
        let mut out = Output::default();
        let numbers: Vec<f64> = (1..=n).map(|i| i as f64).collect();
        out.curve("curves/specimens/number", "1", &numbers);
        out.curve("curves/specimens/overhang", "m", overhangs);
        out.curve("curves/specimens/stiffness", "N m", &stiffnesses);
        out.curve("curves/specimens/mean", "N m", &vec![mean; n]);
        plot(&mut out);
        let relative = if mean > 0.0 {
            100.0 * deviation / mean
        } else {
            0.0
        };
        let note = [format!(
            "Bending stiffness ({}) from a standard cantilever test of {n} specimens ({}): standard deviation {} %.",
            p.bending,
            table.source,
            significant(relative)
        )];
        let law = json!({"linear": quantity(mean, 1e-3, "N mm")});
        let path = ["bending", p.bending.as_str()];
        let (name, text) = material::file(
            template.as_ref(),
            &[(&path, Some(law))],
            "bending.yaml",
            &note,
        )?;
        out.file(&name, &text);
        out.about.source = Some(table.source);
        out.about.bending = Some(p.bending);
        out.result("bending_stiffness", mean, "N m");
        out.result("bending_stiffness_deviation", deviation, "N m");
        if n > 1 {
            let error = student(n - 1) * deviation / (n as f64).sqrt();
            out.result("bending_stiffness_error", error, "N m");
        }
        out.result("bending_length", (mean / weight).fixed_cbrt(), "m");
        out.result("specimens", n as f64, "1");
        out.write(host)
    }
}
