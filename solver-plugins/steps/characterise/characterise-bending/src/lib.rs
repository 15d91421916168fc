//! Step plugin `characterise-bending`: the law M(k) from the profile of a revised cantilever test.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_characterisation::bending::{Bending, Specimen, characterise};
use plyflow_characterisation::cantilever::{
    PLAUSIBLE_OVERHANG, implausible_stiffness, mean_and_deviation,
};
use plyflow_characterisation::csv::{Column, distinct, read};
use plyflow_characterisation::material::{self, Template, quantity, significant};
use plyflow_characterisation::output::Output;
use plyflow_characterisation::profile::{Choice, Method, Profile};
use plyflow_characterisation::voce::Saturation;
use plyflow_characterisation::{Dimension, GRAVITY};
use plyflow_fixed::FixedBits;
use plyflow_model::artifact::{Series, Style};
use plyflow_sdk::{Host, Input, Log, Step, StepError, export_step};
use serde::Deserialize;
use serde_json::json;

/// The step.
pub struct CharacteriseBending;

export_step!(CharacteriseBending);

#[derive(Deserialize)]
struct Parameters {
    profiles: Vec<String>,
    areal_mass: Option<f64>,
    overhang: Option<f64>,
    fit: Method,
    degree: Option<usize>,
    maximum_degree: usize,
    trim: f64,
    clamp_tolerance: f64,
    bending: String,
    report_at: Vec<f64>,
    template: Option<String>,
}

/// No strip of fabric is tested with less outside the clamp (m).
const LEAST_REACH: f64 = 0.01;
/// Overhangs (m) with which strips are tested: lengths in centimetres under a header in millimetres show.
const USUAL_OVERHANG: [f64; 2] = [0.025, 0.6];
/// A strip that lies so many times farther from its points than the polynomial, and farther than this part of its length, is not one of Voce's law.
const MUCH_FARTHER: f64 = 1.5;
const FAR: f64 = 5e-4;

const COLUMNS: [Column; 2] = [
    Column::required("x", Dimension::Length),
    Column::required("z", Dimension::Length),
];

impl Step for CharacteriseBending {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let template = Template::of(host, p.template.as_deref())?;
        let weight = GRAVITY * material::areal_mass(p.areal_mass, template.as_ref())?;
        let (profiles, names) = profiles(host, &p)?;
        let choice = Choice {
            method: p.fit,
            degree: p.degree,
            maximum_degree: p.maximum_degree,
            trim: p.trim,
            overhang: p.overhang,
        };
        let found = characterise(&profiles, weight, &choice)?;
        warn(host, &found, &names);
        warn_of_reach(host, &found, &p.report_at);
        warn_of_units(host, &found, weight, &names);
        let mut out = Output::default();
        write_profiles(&mut out, &found, &profiles, &names);
        write_law(&mut out, &found, &names);
        let law = found.voce.law;
        let block = json!({
            "linear": quantity(law.linear, 1e-3, "N mm"),
            "asymptote": quantity(law.asymptote, 1.0, "N"),
            "scale": quantity(law.scale, 1e3, "1/mm"),
        });
        let note = [
            format!(
                "Bending ({}) from the profile of a revised cantilever test: {}.",
                p.bending,
                names.join(", ")
            ),
            format!(
                "M(k) is told within {} % (rms, at 95 %) and holds to {} 1/mm; beyond, it is an extrapolation.",
                significant(100.0 * found.relative_error),
                significant(1e-3 * found.curvature.last().copied().unwrap_or(0.0))
            ),
        ];
        let path = ["bending", p.bending.as_str()];
        let (name, text) = material::file(
            template.as_ref(),
            &[(&path, Some(block))],
            "bending.yaml",
            &note,
        )?;
        out.file(&name, &text);
        out.about.sources = Some(names);
        out.about.bending = Some(p.bending);
        write_results(&mut out, &found, &profiles);
        for (i, k) in p.report_at.iter().enumerate() {
            out.result(&format!("moment.{}", i + 1), law.moment(*k), "N");
        }
        out.write(host)
    }
}

/// Profiles and what they are called, from files or from the input.
fn profiles(host: &Host, p: &Parameters) -> Result<(Vec<Profile>, Vec<String>), StepError> {
    let inputs = host.inputs_of("profile")?;
    match (inputs.first(), p.profiles.is_empty()) {
        (None, true) => Err(
            "neither the parameter `profiles` nor the input `profile` is given; give one of them"
                .into(),
        ),
        (Some(_), false) => Err(
            "both the parameter `profiles` and the input `profile` are given; give one of them"
                .into(),
        ),
        (Some(input), true) => Ok((
            vec![simulated(host, input, p.clamp_tolerance)?],
            vec![input.step.clone()],
        )),
        (None, false) => {
            let (mut profiles, mut names) = (Vec::new(), Vec::new());
            let mut tables = Vec::new();
            for path in &p.profiles {
                let table = read(path, &COLUMNS)?;
                table.at_least(
                    plyflow_characterisation::profile::FEWEST_POINTS,
                    "a profile",
                )?;
                // Not what is small: points near the clamp are.
                for name in ["x", "z"] {
                    let range = [0.0, PLAUSIBLE_OVERHANG[1]];
                    table.plausible_length(name, range, "a strip of fabric")?;
                }
                let (x, z) = (table.values("x")?, table.values("z")?);
                reaches_out(&table.source, x, z)?;
                profiles.push(Profile::new(x, z, p.clamp_tolerance, &|i| table.place(i))?);
                names.push(table.source.clone());
                tables.push(table);
            }
            distinct(&tables)?;
            Ok((profiles, names))
        }
    }
}

/// Refuses a profile that hangs out by less than a strip of fabric can be tested with: its unit is not that of the header.
fn reaches_out(source: &str, x: &[f64], z: &[f64]) -> Result<(), String> {
    let far = x
        .iter()
        .zip(z)
        .fold(0.0f64, |m, (x, z)| m.max(x.fixed_hypot(*z)));
    if far >= LEAST_REACH {
        return Ok(());
    }
    Err(format!(
        "{source}: the farthest point lies {:.3} mm from the clamp; a strip of fabric hangs out {:.0} mm to {:.0} m: are the units of \
         the header, [..], those of the numbers?",
        1e3 * far,
        1e3 * LEAST_REACH,
        PLAUSIBLE_OVERHANG[1]
    ))
}

fn simulated(host: &Host, input: &Input, clamp_tolerance: f64) -> Result<Profile, StepError> {
    let read = |path: &str| -> Result<Vec<f64>, StepError> {
        let (values, shape) = host.array_f64(input, path)?;
        if shape.len() == 1 {
            return Ok(values);
        }
        Err(format!(
            "array '{path}' of '{}' has {} axes; one value per point is expected",
            input.step,
            shape.len()
        )
        .into())
    };
    let (x, z) = (read("profile/x")?, read("profile/z")?);
    let place = |i: usize| format!("profile of '{}', point {i}", input.step);
    Ok(Profile::new(&x, &z, clamp_tolerance, &place)?)
}

/// Says where the law is used or told beyond what was measured, or is none that a fabric has.
fn warn_of_reach(host: &Host, found: &Bending, report_at: &[f64]) {
    let largest = found.curvature.last().copied().unwrap_or(0.0);
    let beyond: Vec<String> = (report_at.iter())
        .filter(|k| **k > 1.05 * largest)
        .map(|k| format!("{} 1/mm", significant(1e-3 * k)))
        .collect();
    if !beyond.is_empty() {
        let text = format!(
            "`report_at` asks for the moment at {}, and the strips are bent to {} 1/mm: there the moment is an extrapolation",
            beyond.join(", "),
            significant(1e-3 * largest)
        );
        host.log(Log::Warn, &text);
    }
    if let Some(text) = implausible_stiffness(found.voce.law.initial_stiffness()) {
        host.log(Log::Warn, &text);
    }
}

/// Says where lengths or the weight are none that strips of fabric have.
fn warn_of_units(host: &Host, found: &Bending, weight: f64, names: &[String]) {
    let [low, high] = USUAL_OVERHANG;
    for (specimen, name) in found.specimens.iter().zip(names) {
        let overhang = specimen.hanging.length;
        if !(low..=high).contains(&overhang) {
            let text = format!(
                "{name}: the strip hangs out by {} mm; such strips hang out by {:.0} to {:.0} mm: look at the units of the header, [..], as moments go with the \
                 third power of the lengths",
                significant(1e3 * overhang),
                1e3 * low,
                1e3 * high
            );
            host.log(Log::Warn, &text);
        }
    }
    if let Some(text) = material::implausible_areal_mass(weight / GRAVITY) {
        host.log(Log::Warn, &text);
    }
}

fn warn(host: &Host, found: &Bending, names: &[String]) {
    for (specimen, name) in found.specimens.iter().zip(names) {
        let (strip, fit) = (&specimen.hanging, &specimen.profile);
        if strip.rms > MUCH_FARTHER * fit.rms && strip.rms > FAR * strip.length {
            let text = format!(
                "{name}: no strip of a Voce law hangs through the points: it lies {:.3} mm from them, a free curve {:.3} mm. The clamp may \
                 be tilted, the edge of the clamp not at x = z = 0, the tip held, or the strip of changing stiffness; look at the plot",
                1e3 * strip.rms,
                1e3 * fit.rms
            );
            host.log(Log::Warn, &text);
        }
        if !specimen.profile.monotone {
            let text = format!(
                "{name}: the curvature of the fitted profile does not fall from clamp to tip, as gravity makes it: the \
                 law is doubtful; look at the plot, give a lower `degree` or raise `trim`"
            );
            host.log(Log::Warn, &text);
        }
    }
    match found.voce.saturation {
        Saturation::Determined => {}
        Saturation::NotReached => host.log(
            Log::Warn,
            "the curvatures do not reach far enough to tell the saturation of the moment; M(k) holds over them, its \
             parameters mean little: use a longer overhang",
        ),
        Saturation::AlreadyThere => host.log(
            Log::Warn,
            "the moment is saturated already at the least curvatures that count, as if it began with a step: M(k) \
             holds over them, `scale` and the initial stiffness mean little; look at the points near the tip, where the \
             curvature is small, lower `trim`, and check `overhang`",
        ),
    }
}

/// Paths of the curves of a specimen begin so: numbered only when there are several.
fn prefix(name: &str, number: usize, specimens: usize) -> String {
    match specimens {
        1 => format!("curves/{name}"),
        _ => format!("curves/{name}_{number}"),
    }
}

fn write_profiles(out: &mut Output, found: &Bending, profiles: &[Profile], names: &[String]) {
    let (mut hanging, mut along) = (Vec::new(), Vec::new());
    let n = names.len();
    for (i, (profile, name)) in profiles.iter().zip(names).enumerate() {
        let [x, z] = ["x", "z"].map(|n| format!("curves/measured_{}/{n}", i + 1));
        out.curve(&x, "m", &profile.x);
        out.curve(&z, "m", &negative(&profile.deflection));
        hanging.push(Series::new(name, &x, &z).drawn(Style::Points));
    }
    for (i, (specimen, name)) in found.specimens.iter().zip(names).enumerate() {
        let s = &specimen.profile.stations;
        let path = |what: &str| format!("{}/{what}", prefix("profile", i + 1, n));
        out.curve(&path("arc"), "m", &s.arc);
        out.curve(&path("x"), "m", &s.x);
        out.curve(&path("z"), "m", &negative(&s.deflection));
        out.curve(&path("curvature"), "1/m", &s.curvature);
        out.curve(&path("moment"), "N", &specimen.moment);
        let label = match n {
            1 => "fit".to_owned(),
            _ => format!("fit of {name}"),
        };
        hanging.push(Series::new(&label, path("x"), path("z")).drawn(Style::Line));
        along.push(Series::new(&label, path("arc"), path("curvature")).drawn(Style::Line));
    }
    out.plot(
        "profile",
        "Hanging strip",
        ("distance from the clamp", "mm"),
        ("height", "mm"),
        hanging,
    );
    out.plot(
        "curvature",
        "Curvature along the strip",
        ("arc from the clamp", "mm"),
        ("curvature", "1/mm"),
        along,
    );
}

fn negative(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| -v).collect()
}

fn write_law(out: &mut Output, found: &Bending, names: &[String]) {
    let (mut measured, n) = (Vec::new(), names.len());
    for (i, (specimen, name)) in found.specimens.iter().zip(names).enumerate() {
        let path = prefix("measured_law", i + 1, n);
        let [k, m] = ["curvature", "moment"].map(|what| format!("{path}/{what}"));
        let (s, used) = (&specimen.profile.stations, specimen.used.clone());
        out.curve(&k, "1/m", &s.curvature[used.clone()]);
        out.curve(&m, "N", &specimen.moment[used]);
        let label = match n {
            1 => "from the profile",
            _ => name,
        };
        measured.push(Series::new(label, &k, &m).drawn(Style::Points));
    }
    let of = |f: &dyn Fn(f64) -> f64| found.curvature.iter().map(|k| f(*k)).collect::<Vec<f64>>();
    let law = found.voce.law;
    out.curve("curves/law/curvature", "1/m", &found.curvature);
    out.curve("curves/law/moment", "N", &of(&|k| law.moment(k)));
    out.curve("curves/law/moment_error", "N", &found.moment_error);
    out.curve("curves/law/stiffness", "N m", &of(&|k| law.moment(k) / k));
    let k = ("curvature", "1/mm");
    let voce = |y: &str| Series::new("Voce", "curves/law/curvature", y).drawn(Style::Line);
    measured.push(voce("curves/law/moment"));
    out.plot(
        "moment",
        "Moment over curvature",
        k,
        ("moment per width", "N"),
        measured,
    );
    out.plot(
        "stiffness",
        "Secant bending stiffness",
        k,
        ("bending stiffness", "N mm"),
        vec![voce("curves/law/stiffness")],
    );
}

fn write_results(out: &mut Output, found: &Bending, profiles: &[Profile]) {
    let voce = &found.voce;
    let flag = |b: bool| if b { 1.0 } else { 0.0 };
    let over_specimens =
        |f: &dyn Fn(&Specimen) -> f64| found.specimens.iter().map(f).collect::<Vec<f64>>();
    let largest =
        |f: &dyn Fn(&Specimen) -> f64| over_specimens(f).into_iter().fold(0.0f64, f64::max);
    let [lengths, rms, strip_rms] = [
        over_specimens(&|s| s.hanging.length),
        over_specimens(&|s| s.profile.rms),
        over_specimens(&|s| s.hanging.rms),
    ];
    // Over the points of all specimens.
    let count = |p: &Profile| p.x.len() as f64;
    let points: f64 = profiles.iter().map(count).sum();
    let pooled = |rms: &[f64]| {
        let squares = rms.iter().zip(profiles).map(|(r, p)| r * r * count(p));
        (squares.sum::<f64>() / points).sqrt()
    };
    let monotone = found.specimens.iter().all(|s| s.profile.monotone);
    let results = [
        ("linear", voce.law.linear, "N m"),
        ("asymptote", voce.law.asymptote, "N"),
        ("scale", voce.law.scale, "1/m"),
        ("initial_stiffness", voce.law.initial_stiffness(), "N m"),
        ("law_rms", voce.relative_rms, "1"),
        ("law_error", found.relative_error, "1"),
        ("law_condition", voce.condition, "1"),
        (
            "saturation_undetermined",
            flag(voce.saturation != Saturation::Determined),
            "1",
        ),
        (
            "largest_curvature",
            found.curvature.last().copied().unwrap_or(0.0),
            "1/m",
        ),
        ("largest_moment", largest(&|s| s.largest()[1]), "N"),
        ("specimens", found.specimens.len() as f64, "1"),
        ("overhang", mean_and_deviation(&lengths)[0], "m"),
        ("profile_rms", pooled(&rms), "m"),
        ("strip_rms", pooled(&strip_rms), "m"),
        ("profile_degree", largest(&|s| s.profile.degree as f64), "1"),
        ("profile_condition", largest(&|s| s.profile.condition), "1"),
        ("profile_monotone", flag(monotone), "1"),
    ];
    for (name, value, unit) in results {
        out.result(name, value, unit);
    }
    let parameters = ["linear_error", "asymptote_error", "scale_error"];
    for (name, error) in parameters.iter().zip(found.parameter_error) {
        if let Some(error) = error {
            out.result(name, error, "1");
        }
    }
}
