//! Step plugin `characterise-picture-frame`: shear law of yarns and stitch from picture-frame tests.

use plyflow_characterisation::Dimension;
use plyflow_characterisation::csv::{Column, read};
use plyflow_characterisation::material::{self, Block, Template, quantity, significant};
use plyflow_characterisation::output::{Output, Series};
use plyflow_characterisation::picture_frame::{
    Frame, LARGEST_OFFSET, LIMITS, Shear, Test, characterise,
};
use plyflow_characterisation::yarns::{MUCH_WORSE, Refused, Yarns};
use plyflow_sdk::{Host, Log, Step, StepError, export_step};
use serde::Deserialize;
use serde_json::{Value, json};

/// The step.
pub struct CharacterisePictureFrame;

export_step!(CharacterisePictureFrame);

#[derive(Deserialize)]
struct Parameters {
    positive: Vec<String>,
    negative: Vec<String>,
    frame_side: f64,
    specimen_side: Option<f64>,
    stitch: bool,
    degree: Option<usize>,
    maximum_angle: f64,
    template: Option<String>,
}

const COLUMNS: [Column; 2] = [
    Column::required("displacement", Dimension::Length),
    Column::required("force", Dimension::Force),
];
/// Points of a fitted curve.
const POINTS: usize = 240;

impl Step for CharacterisePictureFrame {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let template = Template::of(host, p.template.as_deref())?;
        if p.positive.is_empty() {
            return Err("`positive` is empty; give at least one CSV file of a test".into());
        }
        let frame = Frame {
            side: p.frame_side,
            specimen_side: p.specimen_side.unwrap_or(p.frame_side),
        };
        if frame.specimen_side > frame.side {
            return Err("`specimen_side` is larger than `frame_side`; the sheared part lies within the frame".into());
        }
        let mut out = Output::default();
        let (positive, mut series) =
            read_tests(host, &mut out, &frame, &p.positive, "positive", 1.0)?;
        let (negative, more) = read_tests(host, &mut out, &frame, &p.negative, "negative", -1.0)?;
        let shear = characterise(&positive, &negative, p.stitch, p.degree, p.maximum_angle)?;
        if let Some(refused) = &shear.refused {
            warn(host, refused, &shear);
        }
        series.extend(more);
        write_fit(&mut out, &shear, !negative.is_empty(), series);
        write_file(host, &mut out, &shear, template.as_ref(), &p)?;
        write_results(&mut out, &shear, !negative.is_empty());
        out.write(host)
    }
}

fn read_tests(
    host: &Host,
    out: &mut Output,
    frame: &Frame,
    paths: &[String],
    name: &str,
    sign: f64,
) -> Result<(Vec<Test>, Vec<Series>), StepError> {
    let (mut tests, mut series) = (Vec::new(), Vec::new());
    for (i, path) in paths.iter().enumerate() {
        let table = read(path, &COLUMNS)?;
        let test = Test::new(&table, frame)?;
        if test.offset() > LARGEST_OFFSET {
            let text = format!(
                "{}: the force does not start at 0: at the square frame it is {:.0} % of the largest: subtract the offset \
                 of the load cell, or the fitted law is wrong at small shear",
                table.source,
                100.0 * test.offset()
            );
            host.log(Log::Warn, &text);
        }
        let [x, y] =
            ["shear_angle", "normalised_force"].map(|n| format!("curves/{name}_{}/{n}", i + 1));
        let signed = |v: &[f64]| v.iter().map(|v| sign * v).collect::<Vec<_>>();
        out.curve(&x, "rad", &signed(&test.angle));
        out.curve(&y, "N/m", &signed(&test.force));
        series.push(Series::new(&table.source, &x, &y, "points"));
        tests.push(test);
    }
    Ok((tests, series))
}

/// Says what the material does not take, where that changes the law.
fn warn(host: &Host, refused: &Refused, shear: &Shear) {
    let rms = shear.yarns_rms;
    let Refused {
        degree,
        rms: best,
        why,
        table_differs,
    } = refused;
    let text = match (table_differs, &shear.yarns) {
        (Some([from, to]), _) => format!(
            "no polynomial that was tried is one that material-fabric takes; the file has a `table`, which differs from \
             the polynomial of degree {degree} between {:.1} and {:.1} deg, where that does not rise. Look at the data \
             there: an offset or noise near 0, a load cell of the wrong sign, wrinkles? Of degree {degree} the material \
             says: {why}",
            from.to_degrees(),
            to.to_degrees()
        ),
        (None, Yarns::Polynomial(p)) if rms > MUCH_WORSE * best => format!(
            "the polynomial of degree {degree} follows the data better than the one of degree {} that is taken (residual \
             {best:.3} and {rms:.3} N/m), but material-fabric does not take it: {why}",
            p.coefficients.len() - 1
        ),
        _ => return,
    };
    host.log(Log::Warn, &text);
}

fn write_fit(out: &mut Output, shear: &Shear, both: bool, mut series: Vec<Series>) {
    let from = if both { -shear.limit } else { 0.0 };
    let angle: Vec<f64> = (0..=POINTS)
        .map(|i| from + (shear.limit - from) * i as f64 / POINTS as f64)
        .collect();
    let of = |f: &dyn Fn(f64) -> f64| angle.iter().map(|g| f(*g)).collect::<Vec<f64>>();
    out.curve("curves/fit/shear_angle", "rad", &angle);
    out.curve(
        "curves/fit/normalised_force",
        "N/m",
        &of(&|g| shear.force(g)),
    );
    let x = "curves/fit/shear_angle";
    series.push(Series::new("fit", x, "curves/fit/normalised_force", "line"));
    if shear.stitch.is_some() {
        out.curve("curves/fit/yarns", "N/m", &of(&|g| shear.yarns.odd(g)));
        series.push(Series::new("yarns", x, "curves/fit/yarns", "dashed"));
    }
    let axes = [("shear angle", "deg"), ("normalised shear force", "N/m")];
    out.plot("shear", "Normalised shear force", axes[0], axes[1], &series);
}

/// Says what becomes of the template's law for negative shear, where that may not be what is meant. `turned`: its stitch is stretched there.
fn warn_of_negative(host: &Host, p: &Parameters, turned: bool) {
    let text = if !p.negative.is_empty() {
        "the template has a law of its own for negative shear (`shear.negative`); the new one is fitted to tests of both directions \
         and takes its place. To keep two laws, evaluate each direction by itself as `positive` and join them by hand"
    } else if turned {
        "the template's stitch is stretched in negative shear (`stitch.direction`) and its `shear.negative` stays as it was: the law of these tests \
         is written as that of positive shear. If they stretched the stitch, put it into `shear.negative` by hand"
    } else {
        return;
    };
    host.log(Log::Warn, text);
}

fn write_file(
    host: &Host,
    out: &mut Output,
    shear: &Shear,
    template: Option<&Template>,
    p: &Parameters,
) -> Result<(), StepError> {
    let all = |values: &[f64], unit: &str| -> Vec<Value> {
        let texts = values.iter().map(|v| quantity(*v, 1.0, unit));
        texts.map(Value::from).collect()
    };
    let told = |path: &[&str]| template.and_then(|t| t.parameter(path)).cloned();
    let mut law = match &shear.yarns {
        Yarns::Polynomial(p) => {
            let limit = shear.limit.clamp(LIMITS[0], LIMITS[1]);
            json!({"coefficients": all(&p.coefficients, "N/m"), "limit": quantity(limit, 1.0, "rad")})
        }
        Yarns::Table { angles, forces } => {
            json!({"table": {"angles": all(angles, "rad"), "forces": all(forces, "N/m")}})
        }
    };
    let direction = told(&["stitch", "direction"]);
    if let Some(negative) = told(&["shear", "negative"]) {
        let turned = direction.as_ref().is_some_and(|d| d == "negative");
        warn_of_negative(host, p, turned);
        if p.negative.is_empty() {
            law["negative"] = negative;
        }
    }
    let stitch = shear.stitch.map(|s| {
        let angles = s.stitch.angles.map(|g| quantity(g, 1.0, "rad"));
        let forces = [0.0, s.stitch.peak, 0.0].map(|f| quantity(f, 1.0, "N/m"));
        let mut block = json!({"angles": angles, "forces": forces});
        // The tests tell what it carries, the template which sign of shear stretches it.
        if let Some(direction) = &direction {
            block["direction"] = direction.clone();
        }
        block
    });
    let note = [format!(
        "Shear from {} positive and {} negative picture-frame tests, to {} deg: rms residual {} % of the force.",
        p.positive.len(),
        p.negative.len(),
        significant(shear.limit.to_degrees()),
        significant(100.0 * shear.positive_relative_rms)
    )];
    // A stitch of the template would be counted twice where the yarns' polynomial holds all of the force.
    let blocks: [Block<'_>; 2] = [(&["shear"], Some(law)), (&["stitch"], stitch)];
    let (name, text) = material::file(template, &blocks, "shear.yaml", &note)?;
    out.file(&name, &text);
    Ok(())
}

fn write_results(out: &mut Output, shear: &Shear, both: bool) {
    if let Yarns::Polynomial(p) = &shear.yarns {
        for (n, c) in p.coefficients.iter().enumerate().skip(1) {
            out.result(&format!("coefficient.{n}"), *c, "N/m");
        }
        out.result("degree", (p.coefficients.len() - 1) as f64, "1");
    }
    let table = matches!(shear.yarns, Yarns::Table { .. });
    out.result("table", f64::from(u8::from(table)), "1");
    out.result("limit", shear.limit, "rad");
    out.result("condition", shear.condition, "1");
    out.result("yarns_rms", shear.yarns_relative_rms, "1");
    out.result("positive_rms", shear.positive_relative_rms, "1");
    if both {
        out.result("negative_rms", shear.negative_relative_rms, "1");
    }
    if let Some(fit) = shear.stitch {
        let [onset, top, end] = fit.stitch.angles;
        out.result("stitch_onset", onset, "rad");
        out.result("stitch_peak_angle", top, "rad");
        out.result("stitch_end", end, "rad");
        out.result("stitch_peak", fit.stitch.peak, "N/m");
        out.result("stitch_condition", fit.condition, "1");
    }
}
