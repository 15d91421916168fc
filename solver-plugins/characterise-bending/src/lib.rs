//! Step plugin `characterise-bending`: the law M(k) from the profile of a revised cantilever test.

use plyflow_characterisation::bending::{Bending, characterise};
use plyflow_characterisation::cantilever::PLAUSIBLE_OVERHANG;
use plyflow_characterisation::csv::{Column, read};
use plyflow_characterisation::material::{self, Template, quantity, significant};
use plyflow_characterisation::output::{Output, Series};
use plyflow_characterisation::profile::{Choice, Method, Profile};
use plyflow_characterisation::{Dimension, GRAVITY};
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
        warn(host, &found);
        let mut out = Output::default();
        write_profile(&mut out, &found, &profiles, &names);
        write_law(&mut out, &found);
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
                "The law leaves {} % rms of the measured moment and holds to {} 1/mm; beyond, it is an extrapolation.",
                significant(100.0 * found.voce.relative_rms),
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
        out.attribute("sources", json!(names));
        out.attribute("bending", json!(p.bending));
        write_results(&mut out, &found);
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
                profiles.push(Profile::new(x, z, p.clamp_tolerance, &|i| table.place(i))?);
                names.push(table.source.clone());
            }
            Ok((profiles, names))
        }
    }
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

fn warn(host: &Host, found: &Bending) {
    if !found.profile.monotone {
        host.log(
            Log::Warn,
            "the curvature of the fitted profile does not fall from clamp to tip, as gravity makes it: the law is \
             doubtful; look at the plot, give a lower `degree` or raise `trim`",
        );
    }
    if found.voce.saturation_undetermined {
        host.log(
            Log::Warn,
            "the curvatures do not reach far enough to tell the saturation of the moment; M(k) holds over them, its \
             parameters mean little: use a longer overhang",
        );
    }
}

fn write_profile(out: &mut Output, found: &Bending, profiles: &[Profile], names: &[String]) {
    let mut series = Vec::new();
    for (i, (profile, name)) in profiles.iter().zip(names).enumerate() {
        let [x, z] = ["x", "z"].map(|n| format!("curves/measured_{}/{n}", i + 1));
        out.curve(&x, "m", &profile.x);
        out.curve(
            &z,
            "m",
            &profile.deflection.iter().map(|y| -y).collect::<Vec<_>>(),
        );
        series.push(Series::new(name, &x, &z, "points"));
    }
    let s = &found.profile.stations;
    out.curve("curves/profile/arc", "m", &s.arc);
    out.curve("curves/profile/x", "m", &s.x);
    out.curve(
        "curves/profile/z",
        "m",
        &s.deflection.iter().map(|y| -y).collect::<Vec<_>>(),
    );
    out.curve("curves/profile/curvature", "1/m", &s.curvature);
    out.curve("curves/profile/moment", "N", &found.moment);
    series.push(Series::new(
        "fit",
        "curves/profile/x",
        "curves/profile/z",
        "line",
    ));
    out.plot(
        "profile",
        "Hanging strip",
        ("distance from the clamp", "mm"),
        ("height", "mm"),
        &series,
    );
    let along = [Series::new(
        "fit",
        "curves/profile/arc",
        "curves/profile/curvature",
        "line",
    )];
    out.plot(
        "curvature",
        "Curvature along the strip",
        ("arc from the clamp", "mm"),
        ("curvature", "1/mm"),
        &along,
    );
}

fn write_law(out: &mut Output, found: &Bending) {
    let s = &found.profile.stations;
    out.curve(
        "curves/measured_law/curvature",
        "1/m",
        &s.curvature[found.used.clone()],
    );
    out.curve(
        "curves/measured_law/moment",
        "N",
        &found.moment[found.used.clone()],
    );
    let of = |f: &dyn Fn(f64) -> f64| found.curvature.iter().map(|k| f(*k)).collect::<Vec<f64>>();
    let law = found.voce.law;
    out.curve("curves/law/curvature", "1/m", &found.curvature);
    out.curve("curves/law/moment", "N", &of(&|k| law.moment(k)));
    out.curve("curves/law/moment_error", "N", &found.moment_error);
    out.curve("curves/law/stiffness", "N m", &of(&|k| law.moment(k) / k));
    let k = ("curvature", "1/mm");
    out.plot(
        "moment",
        "Moment over curvature",
        k,
        ("moment per width", "N"),
        &[
            Series::new(
                "from the profile",
                "curves/measured_law/curvature",
                "curves/measured_law/moment",
                "points",
            ),
            Series::new("Voce", "curves/law/curvature", "curves/law/moment", "line"),
        ],
    );
    let secant = [Series::new(
        "Voce",
        "curves/law/curvature",
        "curves/law/stiffness",
        "line",
    )];
    out.plot(
        "stiffness",
        "Secant bending stiffness",
        k,
        ("bending stiffness", "N mm"),
        &secant,
    );
}

fn write_results(out: &mut Output, found: &Bending) {
    let (voce, profile) = (&found.voce, &found.profile);
    let flag = |b: bool| if b { 1.0 } else { 0.0 };
    let [linear_error, asymptote_error, scale_error] = found.parameter_error;
    let largest_moment = found.moment[found.used.clone()]
        .iter()
        .fold(0.0f64, |m, v| m.max(*v));
    let results = [
        ("linear", voce.law.linear, "N m"),
        ("asymptote", voce.law.asymptote, "N"),
        ("scale", voce.law.scale, "1/m"),
        ("initial_stiffness", voce.law.initial_stiffness(), "N m"),
        ("law_rms", voce.relative_rms, "1"),
        ("law_error", found.relative_error, "1"),
        ("linear_error", linear_error, "1"),
        ("asymptote_error", asymptote_error, "1"),
        ("scale_error", scale_error, "1"),
        ("law_condition", voce.condition, "1"),
        (
            "saturation_undetermined",
            flag(voce.saturation_undetermined),
            "1",
        ),
        (
            "largest_curvature",
            found.curvature.last().copied().unwrap_or(0.0),
            "1/m",
        ),
        ("largest_moment", largest_moment, "N"),
        ("overhang", profile.length, "m"),
        ("profile_rms", profile.rms, "m"),
        ("profile_degree", profile.degree as f64, "1"),
        ("profile_condition", profile.condition, "1"),
        ("profile_monotone", flag(profile.monotone), "1"),
    ];
    for (name, value, unit) in results {
        out.result(name, value, unit);
    }
}
