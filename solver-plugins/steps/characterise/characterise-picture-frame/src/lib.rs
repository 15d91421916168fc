//! Step plugin `characterise-picture-frame`: shear law of yarns and stitch from picture-frame tests.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_characterisation::Dimension;
use plyflow_characterisation::csv::{Column, Table, distinct, read};
use plyflow_characterisation::material::{self, Block, Template, quantity, significant};
use plyflow_characterisation::output::Output;
use plyflow_characterisation::picture_frame::{
    Frame, LIMITS, Law, Shear, Test, ZeroChoice, characterise,
};
use plyflow_characterisation::yarns::{MUCH_WORSE, Refused, Yarns, YarnsFit};
use plyflow_characterisation::zero::Start;
use plyflow_model::artifact::{Series, Style};
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
    zero: ZeroChoice,
    template: Option<String>,
}

/// Largest normalised forces of tests of dry and of prepreg fabrics (N/m): what lies outside is a wrong unit.
const PLAUSIBLE_FORCE: [f64; 2] = [3.0, 1e4];
/// An error of the stiffness at rest above this part of it is warned of.
const STIFFNESS_UNSURE: f64 = 0.2;
/// A law whose rise on the whole is less than this part of that at rest is not one of a fabric that locks.
const FALLS_OFF: f64 = 0.25;
/// As is a piece without a row of this part of the range, and of this angle (rad).
const GAP: [f64; 2] = [0.1, 0.05];
/// And tests of one sign whose mean forces differ by this part from their mean.
const SCATTER: f64 = 0.2;
/// And tests that end below this angle (rad).
const SHORT: f64 = 0.35;

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
        template.as_ref().map_or(Ok(()), square)?;
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
        let tables = p.positive.iter().chain(&p.negative);
        let tables = tables.map(|path| read(path, &COLUMNS));
        let tables: Vec<Table> = tables.collect::<Result<_, _>>()?;
        distinct(&tables)?;
        let (up, down) = tables.split_at(p.positive.len());
        let (positive, mut series) =
            read_tests(host, &mut out, &frame, (up, p.zero, p.stitch), 1.0)?;
        let (negative, more) = read_tests(host, &mut out, &frame, (down, p.zero, false), -1.0)?;
        let shear = characterise(&positive, &negative, p.stitch, p.degree, p.maximum_angle)?;
        for (law, which) in laws(&shear) {
            if let Some(refused) = &law.fit.refused {
                warn(host, refused, &law.fit, which);
            }
            warn_of_law(host, law, which);
        }
        warn_of_tests(host, &shear, &tables);
        let tests: Vec<&Test> = positive.iter().chain(&negative).collect();
        series.extend(more);
        write_fit(&mut out, &shear, !negative.is_empty(), series);
        write_file(host, &mut out, &shear, template.as_ref(), &p)?;
        write_results(&mut out, &shear, !negative.is_empty());
        let largest = |f: fn(&Test) -> f64| {
            let all = tests.iter().map(|t| f(t));
            all.fold(0.0f64, |m, v| if v.abs() > m.abs() { v } else { m })
        };
        out.result("zero_displacement", largest(|t| t.zero.displacement), "m");
        out.result("zero_force", largest(|t| t.zero.force), "N");
        out.write(host)
    }
}

/// The laws there are, and what they are called in messages.
fn laws(shear: &Shear) -> Vec<(&Law, &'static str)> {
    match &shear.negative {
        None => vec![(&shear.law, "")],
        Some(other) => vec![
            (&shear.law, "positive shear: "),
            (other, "negative shear: "),
        ],
    }
}

fn read_tests(
    host: &Host,
    out: &mut Output,
    frame: &Frame,
    (tables, choice, stitched): (&[Table], ZeroChoice, bool),
    sign: f64,
) -> Result<(Vec<Test>, Vec<Series>), StepError> {
    let name = if sign > 0.0 { "positive" } else { "negative" };
    let (mut tests, mut series) = (Vec::new(), Vec::new());
    for (i, table) in tables.iter().enumerate() {
        let test = Test::new(table, frame, choice, stitched)?;
        warn_of_zero(host, &table.source, &test, choice);
        warn_of_rows(host, &table.source, &test);
        let [x, y] =
            ["shear_angle", "normalised_force"].map(|n| format!("curves/{name}_{}/{n}", i + 1));
        let signed = |v: &[f64]| v.iter().map(|v| sign * v).collect::<Vec<_>>();
        out.curve(&x, "rad", &signed(&test.points.angle));
        out.curve(&y, "N/m", &signed(&test.points.force));
        series.push(Series::new(&table.source, &x, &y).drawn(Style::Points));
        tests.push(test);
    }
    Ok((tests, series))
}

/// Says where a test does not begin with no force at no displacement, and what was done about it.
fn warn_of_zero(host: &Host, source: &str, test: &Test, choice: ZeroChoice) {
    let zero = &test.zero;
    let (d, f) = (1e3 * zero.displacement, zero.force);
    let what = match zero.start {
        Start::Together => return,
        Start::Displaced => format!(
            "the force begins at a displacement of {d:.3} mm: the cross-head was not set to zero at the square frame"
        ),
        Start::Slack(rows) => format!(
            "the force of the first {rows} rows stays at {f:.3} N and begins to rise at {d:.3} mm: slack, or rows from before the pull"
        ),
        Start::Loaded(f) => format!(
            "the force does not start at 0: at the square frame it is {f:.3} N: an offset of the load cell, a specimen that is held under \
             tension, or yarns that stick"
        ),
        Start::Unclear {
            displacement,
            force,
            drawn_on,
        } => format!(
            "force and displacement do not start together: the first row has {:.3} mm and {force:.3} N, and the curve, drawn on to the square \
             frame, has {drawn_on:.3} N there. Nothing was taken off, and the stiffness at rest is a guess: give rows from the square frame on, \
             without the offset of the load cell",
            1e3 * displacement
        ),
    };
    let then = match (zero.start, choice) {
        (Start::Unclear { .. }, _) => String::new(),
        (_, ZeroChoice::Given) => {
            ". It is not taken off, as `zero: given` says, and the stiffness at rest is wrong by it"
                .into()
        }
        (_, ZeroChoice::Find) => {
            let mut off = Vec::new();
            if zero.displacement != 0.0 {
                off.push(format!("{d:.3} mm"));
            }
            if zero.force != 0.0 {
                off.push(format!("{f:.3} N"));
            }
            format!(
                ". {} taken off: subtract the offset of the load cell and of the cross-head in the file, or set `zero: given` to keep the numbers as they are",
                off.join(" and ") + if off.len() > 1 { " are" } else { " is" }
            )
        }
    };
    host.log(Log::Warn, &format!("{source}: {what}{then}"));
}

/// Says where forces are none that a fabric has, and where rows are missing.
fn warn_of_rows(host: &Host, source: &str, test: &Test) {
    let (angle, force) = (&test.points.angle, &test.points.force);
    let largest = force.iter().fold(0.0f64, |m, f| m.max(f.abs()));
    let [low, high] = PLAUSIBLE_FORCE;
    if !(low..=high).contains(&largest) {
        let text = format!(
            "{source}: the largest shear force is {} N per metre of side; fabrics have {low} to {high} N/m: are [N] and [mm] of the header the \
             units of the numbers, and are the columns not exchanged?",
            significant(largest)
        );
        host.log(Log::Warn, &text);
    }
    let reached = angle.iter().fold(0.0f64, |m, g| m.max(*g));
    if reached < SHORT {
        let text = format!(
            "{source}: the test ends at {:.1} deg, before most fabrics lock: what a ply shears beyond is an extrapolation",
            reached.to_degrees()
        );
        host.log(Log::Warn, &text);
    }
    let [from, to] = test.gap;
    if to - from > (GAP[0] * reached).max(GAP[1]) {
        let text = format!(
            "{source}: there is no row between {:.1} and {:.1} deg of shear: what the law has there is a guess",
            from.to_degrees(),
            to.to_degrees()
        );
        host.log(Log::Warn, &text);
    }
}

/// Says where the law is told so badly at rest that it is none.
fn warn_of_law(host: &Host, law: &Law, which: &str) {
    let (stiffness, error) = (law.fit.yarns.stiffness(), law.fit.error.stiffness);
    if error > STIFFNESS_UNSURE * stiffness.abs() {
        let text = format!(
            "{which}the stiffness at rest, {} N/m, is told within {} N/m only (at 95 %): give more rows below 5 deg, or more tests. It decides \
             where a ply wrinkles",
            significant(stiffness),
            significant(error)
        );
        host.log(Log::Warn, &text);
    }
    let secant = law.fit.yarns.value(law.limit) / law.limit;
    if secant < FALLS_OFF * stiffness {
        let text = format!(
            "{which}at rest the force rises by {} N/m, on the whole by {} N/m: fabrics stiffen as they lock. Are the columns `displacement` and `force` \
             exchanged, or does the frame stick before it moves?",
            significant(stiffness),
            significant(secant)
        );
        host.log(Log::Warn, &text);
    }
}

/// Says where tests of one sign do not agree, and where the signs do not.
fn warn_of_tests(host: &Host, shear: &Shear, tables: &[Table]) {
    if shear.scatter > SCATTER {
        let names = shear.apart.iter().map(|i| tables[*i].source.as_str());
        let text = format!(
            "{}: the mean force of a test is {:.0} % from that of all tests of its sign: are all of one fabric and of one size (`specimen_side`)?",
            names.collect::<Vec<_>>().join(", "),
            100.0 * shear.scatter
        );
        host.log(Log::Warn, &text);
    }
    if let Some(other) = &shear.negative {
        let at = 0.8 * shear.law.limit.min(other.limit);
        let text = format!(
            "positive and negative shear differ: at {:.1} deg the force is {} and {} N/m. Each has its own law, the file one under \
             `shear.negative`; if the fabric has no sign, the specimens differ, or the tests",
            at.to_degrees(),
            significant(shear.law.fit.yarns.value(at)),
            significant(other.fit.yarns.value(at))
        );
        host.log(Log::Info, &text);
    }
}

/// Says what the material does not take, where that changes the law.
fn warn(host: &Host, refused: &Refused, fit: &YarnsFit, which: &str) {
    let rms = fit.rms;
    let Refused {
        degree,
        rms: best,
        why,
        table_differs,
    } = refused;
    let text = match (table_differs, &fit.yarns) {
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
    host.log(Log::Warn, &format!("{which}{text}"));
}

fn write_fit(out: &mut Output, shear: &Shear, both: bool, mut series: Vec<Series>) {
    let limit = shear.law.limit;
    let other = shear.negative.as_ref().map_or(limit, |l| l.limit);
    let from = if both { -other } else { 0.0 };
    let angle: Vec<f64> = (0..=POINTS)
        .map(|i| from + (limit - from) * i as f64 / POINTS as f64)
        .collect();
    let of = |f: &dyn Fn(f64) -> f64| angle.iter().map(|g| f(*g)).collect::<Vec<f64>>();
    out.curve("curves/fit/shear_angle", "rad", &angle);
    out.curve(
        "curves/fit/normalised_force",
        "N/m",
        &of(&|g| shear.force(g)),
    );
    let x = "curves/fit/shear_angle";
    series.push(Series::new("fit", x, "curves/fit/normalised_force").drawn(Style::Line));
    if shear.stitch.is_some() {
        out.curve("curves/fit/yarns", "N/m", &of(&|g| shear.yarns(g).odd(g)));
        series.push(Series::new("yarns", x, "curves/fit/yarns").drawn(Style::Dashed));
    }
    for (law, which) in laws(shear) {
        let path = if which.starts_with("negative") {
            "curves/negative_fit_error"
        } else {
            "curves/fit_error"
        };
        out.curve(&format!("{path}/shear_angle"), "rad", &law.fit.error.angle);
        out.curve(
            &format!("{path}/normalised_force"),
            "N/m",
            &law.fit.error.force,
        );
    }
    let axes = [("shear angle", "deg"), ("normalised shear force", "N/m")];
    out.plot("shear", "Normalised shear force", axes[0], axes[1], series);
}

/// Whether a template's families lie along the arms of a frame, which begins as a square.
fn square(template: &Template) -> Result<(), StepError> {
    match template.parameter(&["crossing"]) {
        Some(angle) => Err(format!(
            "template: its families cross at `crossing: {}`, and a picture frame begins as a square with the fibres along its arms; expected a template without \
             `crossing`: shear counts from the angle at which the test began",
            angle.as_str().map_or_else(|| angle.to_string(), str::to_owned)
        )
        .into()),
        None => Ok(()),
    }
}

/// Says what becomes of the template's law for negative shear, where that may not be what is meant. `turned`: its stitch is stretched there.
fn warn_of_negative(host: &Host, p: &Parameters, shear: &Shear, turned: bool) {
    let text = if shear.negative.is_some() {
        return;
    } else if !p.negative.is_empty() {
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

/// A law as the material takes it.
fn block(law: &Law) -> Value {
    let all = |values: &[f64], unit: &str| -> Vec<Value> {
        let texts = values.iter().map(|v| quantity(*v, 1.0, unit));
        texts.map(Value::from).collect()
    };
    match &law.fit.yarns {
        Yarns::Polynomial(p) => {
            let limit = law.limit.clamp(LIMITS[0], LIMITS[1]);
            json!({"coefficients": all(&p.coefficients, "N/m"), "limit": quantity(limit, 1.0, "rad")})
        }
        Yarns::Table { angles, forces } => {
            json!({"table": {"angles": all(angles, "rad"), "forces": all(forces, "N/m")}})
        }
    }
}

fn write_file(
    host: &Host,
    out: &mut Output,
    shear: &Shear,
    template: Option<&Template>,
    p: &Parameters,
) -> Result<(), StepError> {
    let told = |path: &[&str]| template.and_then(|t| t.parameter(path)).cloned();
    let mut law = block(&shear.law);
    if let Some(other) = &shear.negative {
        law["negative"] = block(other);
    }
    let direction = told(&["stitch", "direction"]);
    if let Some(negative) = told(&["shear", "negative"]) {
        let turned = direction.as_ref().is_some_and(|d| d == "negative");
        warn_of_negative(host, p, shear, turned);
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
        significant(shear.law.limit.to_degrees()),
        significant(100.0 * shear.positive_relative_rms)
    )];
    // A stitch of the template would be counted twice where the yarns' polynomial holds all of the force.
    let blocks: [Block<'_>; 2] = [(&["shear"], Some(law)), (&["stitch"], stitch)];
    let (name, text) = material::file(template, &blocks, "shear.yaml", &note)?;
    out.file(&name, &text);
    Ok(())
}

fn write_results(out: &mut Output, shear: &Shear, both: bool) {
    for (law, which) in laws(shear) {
        let sign = if which.starts_with("negative") {
            "negative_"
        } else {
            ""
        };
        let fit = &law.fit;
        if let Yarns::Polynomial(p) = &fit.yarns {
            for (n, c) in p.coefficients.iter().enumerate().skip(1) {
                out.result(&format!("{sign}coefficient.{n}"), *c, "N/m");
            }
            let degree = (p.coefficients.len() - 1) as f64;
            out.result(&format!("{sign}degree"), degree, "1");
        }
        let table = matches!(fit.yarns, Yarns::Table { .. });
        let results = [
            ("table", f64::from(u8::from(table)), "1"),
            ("limit", law.limit, "rad"),
            ("condition", fit.condition, "1"),
            ("initial_stiffness", fit.yarns.stiffness(), "N/m"),
            ("initial_stiffness_error", fit.error.stiffness, "N/m"),
            ("law_error", fit.error.relative, "1"),
            ("yarns_rms", law.relative_rms, "1"),
        ];
        for (name, value, unit) in results {
            out.result(&format!("{sign}{name}"), value, unit);
        }
    }
    out.result("positive_rms", shear.positive_relative_rms, "1");
    if both {
        out.result("negative_rms", shear.negative_relative_rms, "1");
        let differ = f64::from(u8::from(shear.negative.is_some()));
        out.result("signs_differ", differ, "1");
    }
    out.result("scatter", shear.scatter, "1");
    if let Some(fit) = shear.stitch {
        let [onset, top, end] = fit.stitch.angles;
        out.result("stitch_onset", onset, "rad");
        out.result("stitch_peak_angle", top, "rad");
        out.result("stitch_end", end, "rad");
        out.result("stitch_peak", fit.stitch.peak, "N/m");
        out.result("stitch_condition", fit.condition, "1");
    }
}
