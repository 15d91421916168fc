//! Materials as curves: the laws of the built-in plugins, drawn from the parameters that the run had.
//!
//! The formulas are those of `docs/reference/materials.md`. Points of a table are drawn as they were given, joined by straight lines: a law
//! runs smoothly through them.

use crate::plain::{Plot, Series, Style};
use crate::read::Law;
use crate::units::number;
use maud::{Markup, html};
use serde_json::Value;

/// Size of a plot on the page (px).
const SIZE: [f64; 2] = [420.0, 270.0];
/// Places along a curve of a formula.
const PLACES: usize = 60;
/// Bending is drawn up to this curvature (1/m), of a fold of 20 mm radius.
const CURVATURE: f64 = 50.0;
/// The end of a shear polynomial that does not say one (rad).
const SHEAR_LIMIT: f64 = std::f64::consts::FRAC_PI_3;

/// A material with its curves and all its parameters.
pub(super) fn drawn(law: &Law) -> Markup {
    let plots = plots(&law.plugin, &law.with);
    html! {
        h4 { "Material " (law.name) }
        p class="note" { "Of " (law.sheets.join(", ")) "; plugin " code { (law.plugin) } "."
            @if let Some(source) = &law.source { " Source: " (source) "." }
            @for (name, value) in constants(&law.with) { " " (name) ": " (value) "." } }
        @if !plots.is_empty() { div class="row laws" { @for plot in &plots { (plot.svg()) } } }
        details open[plots.is_empty()] { summary { "All parameters (SI)" } pre { code { (format!("{:#}", law.with)) } } }
    }
}

/// The plots of a plugin's law; none of one that is not built in.
fn plots(plugin: &str, with: &Value) -> Vec<Plot<'static>> {
    match plugin {
        "material-fabric" => fabric(with),
        "material-marlow" => film(with),
        _ => Vec::new(),
    }
}

/// A curve that the report draws of a material, as [`curves`] gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct LawCurve {
    /// Title of its plot.
    pub plot: String,
    /// Its name in the legend; empty where the plot has one curve alone.
    pub name: String,
    /// `[places]`, in the unit of the axis: deg, 1/mm or per cent.
    pub x: Vec<f64>,
    /// `[places]`, in the unit of the axis: N/m, N or MPa.
    pub y: Vec<f64>,
}

/// What the report draws of a material of the plugin `plugin` with these parameters (SI), to be held against the law itself; and what it tells in words.
pub fn curves(plugin: &str, with: &Value) -> (Vec<LawCurve>, Vec<(&'static str, String)>) {
    let of = |plot: Plot<'static>| {
        let title = plot.title.into_owned();
        let series = plot.series.into_iter();
        series.map(move |s| LawCurve {
            plot: title.clone(),
            name: s.name.into_owned(),
            x: s.x.into_owned(),
            y: s.y.into_owned(),
        })
    };
    let all = plots(plugin, with).into_iter().flat_map(of).collect();
    (all, constants(with))
}

/// What a curve does not show.
fn constants(with: &Value) -> Vec<(&'static str, String)> {
    let of = |key: &str| with[key].as_f64();
    // Across the fibres of a unidirectional ply it is a thousandth.
    let modulus = |key: &str| {
        let value = of(key)?;
        Some(match value {
            v if v < 1e8 => format!("{} MPa", number(v * 1e-6, 4)),
            v => format!("{} GPa", number(v * 1e-9, 4)),
        })
    };
    // Where nothing is said of it, fibres are as stiff as in tension.
    let plain = ["compression", "compression_2"]
        .iter()
        .all(|k| with[*k].is_null());
    let share =
        of("compression_factor").or((plain && of("fibre_modulus").is_some()).then_some(1.0));
    let all = [
        ("Modulus along the fibres", modulus("fibre_modulus")),
        ("Modulus of the second family", modulus("fibre_modulus_2")),
        ("Share of it in compression", share.map(|v| number(v, 4))),
        ("Young's modulus", modulus("youngs_modulus")),
    ];
    all.into_iter()
        .filter_map(|(name, v)| Some((name, v?)))
        .collect()
}

/// Numbers of a list.
fn list(value: &Value) -> Vec<f64> {
    let all = value.as_array().into_iter().flatten();
    all.filter_map(Value::as_f64).collect()
}

fn spread(end: f64) -> Vec<f64> {
    (0..=PLACES)
        .map(|k| end * k as f64 / PLACES as f64)
        .collect()
}

fn series(
    name: &str,
    colour: usize,
    style: Style,
    (x, y): (Vec<f64>, Vec<f64>),
) -> Series<'static> {
    Series {
        name: name.to_owned().into(),
        colour,
        style,
        x: x.into(),
        y: y.into(),
    }
}

fn plot(
    title: &'static str,
    x: &'static str,
    y: &'static str,
    series: Vec<Series<'static>>,
) -> Option<Plot<'static>> {
    let plot = Plot {
        title: title.into(),
        x_label: x.into(),
        y_label: y.into(),
        legend_of_one: series.iter().any(|s| !s.name.is_empty()),
        series,
        size: SIZE,
        ..Plot::default()
    };
    (!plot.series.is_empty()).then_some(plot)
}

/// Angles (rad) and normalised forces (N/m) of one sign's yarns: points of a table, or of a formula, which has some at the angles `also`.
fn yarns(shear: &Value, also: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let coefficients = list(&shear["coefficients"]);
    if coefficients.is_empty() {
        let table = &shear["table"];
        let points = (list(&table["angles"]), list(&table["forces"]));
        return (!points.0.is_empty() && points.0.len() == points.1.len()).then_some(points);
    }
    let end = shear["limit"].as_f64().unwrap_or(SHEAR_LIMIT);
    let mut x = spread(end);
    x.extend(also.iter().filter(|g| **g <= end));
    x.sort_by(f64::total_cmp);
    x.dedup();
    let force = |g: &f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * g + c);
    let y = x.iter().map(force).collect();
    Some((x, y))
}

/// Between points, straight; 0 beyond them.
fn between(angles: &[f64], forces: &[f64], at: f64) -> f64 {
    let pieces = angles.windows(2).zip(forces.windows(2));
    let mut holding = pieces.filter(|(a, _)| (a[0]..=a[1]).contains(&at));
    holding.next().map_or(0.0, |(a, f)| {
        f[0] + (f[1] - f[0]) * (at - a[0]) / (a[1] - a[0]).max(1e-300)
    })
}

fn fabric(with: &Value) -> Vec<Plot<'static>> {
    let mut plots = Vec::new();
    plots.extend(plot(
        "Shear",
        "shear angle (deg)",
        "normalised force (N/m)",
        shear(with),
    ));
    plots.extend(plot(
        "Bending",
        "curvature (1/mm)",
        "moment per width (N)",
        bending(&with["bending"]),
    ));
    plots.extend(plot(
        "Fibres in compression",
        "compressive strain (%)",
        "stress (MPa)",
        compression(with),
    ));
    plots
}

/// Stress over strain of fibres that follow a curve in compression, by family where there are two.
fn compression(with: &Value) -> Vec<Series<'static>> {
    let of = |key: &str| {
        let table = &with[key]["table"];
        let (x, y) = (list(&table["strains"]), list(&table["stresses"]));
        let x: Vec<f64> = x.iter().map(|e| 100.0 * e).collect();
        let y: Vec<f64> = y.iter().map(|s| 1e-6 * s).collect();
        (!x.is_empty() && x.len() == y.len()).then_some((x, y))
    };
    let (first, second) = (of("compression"), of("compression_2"));
    // A family with a share of its modulus is told in words.
    let both = second.is_none() && with["compression_factor_2"].is_null();
    let name = if both { "both families" } else { "family 1" };
    let first = first.map(|curve| series(name, 0, Style::Line, curve));
    let second = second.map(|curve| series("family 2", 1, Style::Line, curve));
    first.into_iter().chain(second).collect()
}

/// Angles in degrees; for negative shear both change their signs.
fn turned(sign: f64, (x, y): (&[f64], &[f64])) -> (Vec<f64>, Vec<f64>) {
    let x = x.iter().map(|g| sign * g.to_degrees()).collect();
    (x, y.iter().map(|f| sign * f).collect())
}

/// Forces over the shear angle: of the yarns, and with the stitch where there is one.
fn shear(with: &Value) -> Vec<Series<'static>> {
    let (shear, stitch) = (&with["shear"], &with["stitch"]);
    let (angles, forces) = (list(&stitch["angles"]), list(&stitch["forces"]));
    let Some(positive) = yarns(shear, &angles) else {
        return Vec::new();
    };
    let own = shear["negative"]
        .is_object()
        .then(|| yarns(&shear["negative"], &angles));
    let negative = own.flatten().unwrap_or_else(|| positive.clone());
    let (mut x, mut y) = turned(-1.0, (&negative.0, &negative.1));
    x.reverse();
    y.reverse();
    let more = turned(1.0, (&positive.0, &positive.1));
    x.extend(more.0);
    y.extend(more.1);
    let mut curves = vec![series("yarns", 0, Style::Line, (x, y))];
    if angles.len() > 1 && angles.len() == forces.len() {
        let (sign, (x, y)) = match stitch["direction"] == "negative" {
            true => (-1.0, &negative),
            false => (1.0, &positive),
        };
        let mut at: Vec<f64> = x.iter().chain(&angles).copied().collect();
        at.sort_by(f64::total_cmp);
        at.dedup();
        let sum = |g: &f64| between(x, y, *g) + between(&angles, &forces, *g);
        let sum: Vec<f64> = at.iter().map(sum).collect();
        let name = "with the stitch, until it has failed";
        curves.push(series(name, 1, Style::Dashed, turned(sign, (&at, &sum))));
    }
    curves
}

/// Moments over curvature: of both families and signs, as they differ.
fn bending(b: &Value) -> Vec<Series<'static>> {
    let own = [("family_1", "family 1"), ("family_2", "family 2")];
    let blocks: Vec<(&str, &Value)> = match b["positive"].is_object() {
        true => vec![("", b)],
        false => own
            .iter()
            .map(|(key, name)| (*name, &b[*key]))
            .filter(|(_, v)| v.is_object())
            .collect(),
    };
    let mut all = Vec::new();
    for (family, block) in blocks {
        for sign in ["positive", "negative"] {
            let Some((x, y)) = moments(&block[sign]) else {
                continue;
            };
            let name = match (block["negative"].is_object(), family) {
                (true, "") => sign.to_owned(),
                (true, family) => format!("{family}, {sign}"),
                (false, "") => "both signs".to_owned(),
                (false, family) => family.to_owned(),
            };
            let x = x.iter().map(|k| k * 1e-3).collect();
            all.push(series(&name, all.len(), Style::Line, (x, y)));
        }
    }
    all
}

/// Curvatures (1/m) and moments (N) of a law.
fn moments(law: &Value) -> Option<(Vec<f64>, Vec<f64>)> {
    if law["table"].is_object() {
        let points = (
            list(&law["table"]["curvatures"]),
            list(&law["table"]["moments"]),
        );
        return (points.0.len() == points.1.len()).then_some(points);
    }
    let of = |key: &str| law[key].as_f64();
    let x = spread(CURVATURE);
    if let Some(stiffness) = of("stiffness") {
        let y = x.iter().map(|k| stiffness * k).collect();
        return Some((x, y));
    }
    let (linear, asymptote) = (of("linear").unwrap_or(0.0), of("asymptote").unwrap_or(0.0));
    let scale = of("scale").unwrap_or(1.0);
    let moment = |k: &f64| linear * k + asymptote * (1.0 - (-k / scale).exp());
    let y = x.iter().map(moment).collect();
    law.is_object().then_some((x, y))
}

fn film(with: &Value) -> Vec<Plot<'static>> {
    let u = &with["uniaxial"];
    let of = |key: &str| u[key].as_f64();
    let (mut x, mut y) = (list(&u["strains"]), list(&u["stresses"]));
    if let (Some(amplitude), Some(growth), Some(decay)) =
        (of("amplitude"), of("growth"), of("decay"))
    {
        x = spread(with["limit"].as_f64().unwrap_or(5.0));
        y = x
            .iter()
            .map(|e| amplitude * ((growth * e).exp() - (-decay * e).exp()))
            .collect();
    }
    let points = (
        x.iter().map(|e| e * 100.0).collect(),
        y.iter().map(|s| s * 1e-6).collect(),
    );
    let curve = series("", 0, Style::Line, points);
    plot(
        "Uniaxial tension",
        "nominal strain (%)",
        "nominal stress (MPa)",
        vec![curve],
    )
    .into_iter()
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn at(plot: &Plot<'_>, k: usize, x: f64) -> f64 {
        let s = &plot.series[k];
        let near =
            s.x.iter()
                .zip(s.y.iter())
                .min_by(|a, b| (a.0 - x).abs().total_cmp(&(b.0 - x).abs()));
        let (found, y) = near.unwrap();
        assert!((found - x).abs() < 1.0, "{found} for {x}");
        *y
    }

    #[test]
    fn the_curves_of_a_fabric_are_those_of_its_formulas() {
        let with = json!({"shear": {"coefficients": [0.0, 112.19, 94.73, 137.06, -65.56, 29.56]},
            "stitch": {"direction": "positive", "angles": [0.06, 0.5, 0.75], "forces": [0.0, 880.0, 0.0]},
            "bending": {"positive": {"linear": 1.0e-4, "asymptote": 0.03, "scale": 5.0}, "negative": {"stiffness": 2.0e-3}}});
        let plots = fabric(&with);
        // At 60 deg, g = 1.0472: by hand.
        let g = SHEAR_LIMIT;
        let by_hand = 112.19 * g + 94.73 * g.powi(2) + 137.06 * g.powi(3) - 65.56 * g.powi(4)
            + 29.56 * g.powi(5);
        assert!((at(&plots[0], 0, 60.0) / by_hand - 1.0).abs() < 1e-9);
        assert!(
            (at(&plots[0], 0, -60.0) / by_hand + 1.0).abs() < 1e-9,
            "odd without a law for the negative sign"
        );
        // At its peak the stitch adds 880 N/m, beyond its end nothing; the other sign has none.
        let peak = 0.5f64.to_degrees();
        let bare = 112.19 * 0.5 + 94.73 * 0.25 + 137.06 * 0.125 - 65.56 * 0.0625 + 29.56 * 0.03125;
        assert!(
            (at(&plots[0], 1, peak) - bare - 880.0).abs() < 0.5,
            "{}",
            at(&plots[0], 1, peak)
        );
        assert!((at(&plots[0], 1, 60.0) / by_hand - 1.0).abs() < 1e-9);
        assert!(plots[0].series[1].x.iter().all(|x| *x >= 0.0));
        let far = 1.0e-4 * 50.0 + 0.03 * (1.0 - (-10.0f64).exp());
        assert!((plots[1].series[0].y.last().unwrap() - far).abs() < 1e-12);
        assert!((plots[1].series[1].y.last().unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(plots[1].series[1].name, "negative");
    }

    #[test]
    fn tables_are_drawn_as_given_and_films_by_their_formula() {
        let table = json!({"shear": {"table": {"angles": [0.0, 0.5], "forces": [0.0, 7.0]}, "negative": {"coefficients": [0.0, 4.0], "limit": 0.5}},
            "bending": {"family_1": {"positive": {"stiffness": 1e-3}}, "family_2": {"positive": {"table": {"curvatures": [0.0, 10.0], "moments": [0.0, 0.02]}}}}});
        let plots = fabric(&table);
        assert_eq!(plots[0].series[0].y.first(), Some(&-2.0));
        assert_eq!(plots[0].series[0].y.last(), Some(&7.0));
        let names: Vec<&str> = plots[1].series.iter().map(|s| &*s.name).collect();
        assert_eq!(names, ["family 1", "family 2"]);
        let film = film(
            &json!({"uniaxial": {"amplitude": 6.364e6, "growth": 0.4451, "decay": 7.545}, "limit": 5.0}),
        );
        let last = film[0].series[0].y.last().unwrap();
        assert!((last - 6.364 * ((0.4451f64 * 5.0).exp() - (-7.545f64 * 5.0).exp())).abs() < 1e-9);
        assert_eq!(film[0].series[0].x.last(), Some(&500.0));
    }
}
