//! Step plugin `wrinkle-census`: wrinkles of a formed ply on circles about a vertical axis, sections through it, and the
//! distributions of its deviation and of its bending moments.
//!
//! Made for parts pressed by an axisymmetric punch (thesis chapter 4): there wrinkles run outwards, and a circle crosses
//! each of them once.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod deviation;
mod moments;
mod parameters;
mod plot;
mod ply;
mod spread;
mod surface;
mod trace;
mod waves;

use plyflow_fixed::FixedBits;
pub use surface::{Cut, Hit};
pub use trace::Trace;
pub use waves::{Criteria, Side, median, waves};

use parameters::Parameters;
use plot::{Curve, Plots};
use ply::Ply;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{
    Census, CensusBody, CensusCircle, CrossSection, Map, Panel, SectionWrinkle, Wrinkle,
};
use plyflow_sdk::{Host, Log, On, Step, StepError, export_step};
use plyflow_surface::Topology;
use plyflow_surface::{weighted_mean, weighted_quantiles};
use spread::Spread;
use std::f64::consts::TAU;

/// The step.
pub struct WrinkleCensus;

export_step!(WrinkleCensus);

impl Step for WrinkleCensus {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        p.check()?;
        let input = host.input("formed")?;
        let frame = ply::last_frame(host, &input)?;
        let ply = ply::read(host, &input, frame, p.ply.as_deref())?;
        let rests = deviation::rests(host, &input, frame, &ply, p.surfaces.as_deref())?;
        let cut = Cut::new(&ply.points, &ply.cells, &ply.shear);
        let [x, y] = [p.centre[0], p.centre[1]];
        let around = |radius: f64| -> Vec<Option<Hit>> {
            let place = |i: usize| {
                let (s, c) = (TAU * i as f64 / p.samples as f64).fixed_sin_cos();
                cut.seen([x + radius * c, y + radius * s], p.looks_up())
            };
            (0..p.samples).map(place).collect()
        };
        let mut plots = Plots::default();
        let mut counted = circles(host, &p, &around, &mut plots)?;
        let trace = Trace {
            around: &around,
            what: p.criteria(),
            step: p.trace_step,
            inner: p.inner_circles.iter().copied().fold(p.trace_step, f64::max),
        };
        trace.lengths(p.circles[0], &mut counted[0]);
        let inner = inner_deviation(&p, &around)?;
        sections(host, &p, &cut, &mut plots)?;
        let across = cross_sections(host, &p, &cut, &mut plots)?;
        let deviation = (!rests.is_empty()).then(|| deviation::deviations(&ply.points, &rests));
        let maps = fields(host, &p, &ply, deviation, &mut plots)?;
        let circles = (p.circles.iter().zip(&counted)).map(|(&radius, waves)| CensusCircle {
            radius,
            wrinkles: waves.clone(),
        });
        host.write_attributes(&Census {
            ply: ply.name,
            circles: circles.collect(),
            threshold: Some(p.threshold),
            prominence: Some(p.criteria().prominence),
            cross_sections: across,
            curves: plots.curves,
            plots: plots.plots,
            maps,
        })?;
        results(host, &counted[0], inner)
    }
}

/// A number as a label has it, to a thousandth and without digits that say nothing: labels are what tells curves apart, here and in other censuses.
fn told(value: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (1e3 * value).round() / 1e3 + 0.0
}

/// A circle of which less than this part lies on the ply is told.
const MOSTLY: f64 = 0.95;

/// Counts the wrinkles of every circle and writes its profile.
fn circles(
    host: &Host,
    p: &Parameters,
    around: &dyn Fn(f64) -> Vec<Option<Hit>>,
    plots: &mut Plots,
) -> Result<Vec<Vec<Wrinkle>>, StepError> {
    let (mut counted, mut series) = (Vec::new(), Vec::new());
    for (k, radius) in p.circles.iter().enumerate() {
        let hits = around(*radius);
        let Some(middle) = median(&hits) else {
            return Err(format!(
                "circles: a radius of {:.1} mm lies all beside the ply; take a smaller one, or another centre",
                1e3 * radius
            )
            .into());
        };
        let share = hits.iter().flatten().count() as f64 / hits.len() as f64;
        if share < MOSTLY {
            let text = format!(
                "circles: of the circle with a radius of {:.1} mm only {:.0} % lies on the ply: no wrinkle is counted on the rest",
                1e3 * radius,
                100.0 * share
            );
            host.log(Log::Warn, &text);
        }
        counted.push(waves(&hits, *radius, &p.criteria()));
        let on = hits
            .iter()
            .enumerate()
            .filter_map(|(i, h)| Some((i, (*h)?)));
        let (angle, height): (Vec<f64>, Vec<f64>) = on
            .map(|(i, h)| (TAU * i as f64 / p.samples as f64, h.height - middle))
            .unzip();
        let curve = Curve {
            name: format!("circle_{k}"),
            label: format!("radius {} mm", told(1e3 * radius)),
            x: ("angle", "rad", &angle),
            y: ("height", "m", &height),
        };
        series.push(plots.curve(host, "circles", &curve)?);
    }
    let title = "Height around the axis, less its median";
    plots.heights("circles", title, ["angle from x", "deg"], series);
    Ok(counted)
}

/// Largest deviation (m) from the median on the inner circles.
fn inner_deviation(
    p: &Parameters,
    around: &dyn Fn(f64) -> Vec<Option<Hit>>,
) -> Result<f64, StepError> {
    let mut largest: f64 = 0.0;
    for radius in &p.inner_circles {
        let hits = around(*radius);
        let Some(middle) = median(&hits).filter(|_| hits.iter().all(Option::is_some)) else {
            return Err(format!(
                "inner_circles: a radius of {:.1} mm does not lie all on the ply",
                1e3 * radius
            )
            .into());
        };
        let off = hits.iter().flatten().map(|h| (h.height - middle).abs());
        largest = off.fold(largest, f64::max);
    }
    Ok(largest)
}

/// Half the length of a section (m): as far as the largest circle.
fn half_length(p: &Parameters) -> f64 {
    p.circles.iter().copied().fold(0.0, f64::max)
}

/// What a section sees at places at that distance (m) along the direction (c, s) from `from`, from `-half` to `half`; `None`
/// beside the ply.
fn line(
    p: &Parameters,
    cut: &Cut<'_>,
    from: [f64; 2],
    [c, s]: [f64; 2],
) -> Vec<(f64, Option<Hit>)> {
    let half = half_length(p);
    let place = |i: usize| half * (2.0 * i as f64 / (p.samples - 1) as f64 - 1.0);
    let seen = |d: f64| cut.seen([from[0] + d * c, from[1] + d * s], p.looks_up());
    let at = |i: usize| (place(i), seen(place(i)));
    (0..p.samples).map(at).collect()
}

/// Distances and heights (m) of what is on the ply.
fn profile(seen: &[(f64, Option<Hit>)]) -> (Vec<f64>, Vec<f64>) {
    let on = seen.iter().filter_map(|(d, h)| Some((*d, (*h)?.height)));
    on.unzip()
}

/// Writes the sections through the axis.
fn sections(
    host: &Host,
    p: &Parameters,
    cut: &Cut<'_>,
    plots: &mut Plots,
) -> Result<(), StepError> {
    let mut series = Vec::new();
    for (k, angle) in p.sections.iter().enumerate() {
        let (s, c) = angle.fixed_sin_cos();
        let (along, height) = profile(&line(p, cut, [p.centre[0], p.centre[1]], [c, s]));
        let curve = Curve {
            name: format!("section_{k}"),
            label: format!("section at {} deg", told(angle.to_degrees())),
            x: ("distance", "m", &along),
            y: ("height", "m", &height),
        };
        series.push(plots.curve(host, "sections", &curve)?);
    }
    let axis = ["distance from the axis", "mm"];
    plots.heights("sections", "Sections through the axis", axis, series);
    Ok(())
}

/// Writes the sections across, counts the wrinkles in each by the criteria of the circles, and reports them.
fn cross_sections(
    host: &Host,
    p: &Parameters,
    cut: &Cut<'_>,
    plots: &mut Plots,
) -> Result<Vec<CrossSection>, StepError> {
    let (mut series, mut counted) = (Vec::new(), Vec::new());
    let names = result_names(p)?;
    for (k, (across, name)) in p.cross_sections.iter().zip(names).enumerate() {
        let (s, c) = across.angle.fixed_sin_cos();
        let from = [
            p.centre[0] + across.offset * c,
            p.centre[1] + across.offset * s,
        ];
        let seen = line(p, cut, from, [-s, c]);
        let (along, height) = profile(&seen);
        if along.is_empty() {
            return Err(format!(
                "cross_sections: '{}' at {:.1} mm from the axis lies all beside the ply; take a smaller offset",
                across.label,
                1e3 * across.offset
            )
            .into());
        }
        let curve = Curve {
            name: format!("cross_section_{k}"),
            label: across.label.clone(),
            x: ("distance", "m", &along),
            y: ("height", "m", &height),
        };
        series.push(plots.curve(host, "cross_sections", &curve)?);
        // A closed profile with a place beside the ply between its ends, which no wrinkle crosses.
        let closed: Vec<Option<Hit>> = (seen.iter().map(|(_, h)| *h)).chain([None]).collect();
        let spacing = 2.0 * half_length(p) / (p.samples - 1) as f64;
        let found = waves(&closed, spacing * closed.len() as f64 / TAU, &p.criteria());
        let highest = found.iter().map(|w| w.height.abs()).fold(0.0, f64::max);
        let count = found.len() as f64;
        host.result(&format!("section_wrinkles.{name}"), count, "1")?;
        host.result(&format!("section_height.{name}"), highest, "m")?;
        let places = closed.len() as f64;
        let listed = |w: &Wrinkle| SectionWrinkle {
            place: w.angle / TAU * spacing * places - half_length(p),
            z: w.z,
            height: w.height,
            prominence: w.prominence,
            width: w.width,
            shear: w.shear,
        };
        counted.push(CrossSection {
            label: across.label.clone(),
            result: name,
            wrinkles: found.iter().map(listed).collect(),
        });
    }
    let axis = ["distance along the section", "mm"];
    plots.heights("cross_sections", "Sections across", axis, series);
    Ok(counted)
}

/// A label as a part of a result's name: letters and digits, what lies between them one underscore.
fn plain(label: &str) -> String {
    let words = label.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<String> = (words.filter(|w| !w.is_empty()))
        .map(str::to_lowercase)
        .collect();
    words.join("_")
}

/// The names of the results of the cross sections.
///
/// # Errors
/// When a label has no letter and no digit, or two give one name.
fn result_names(p: &Parameters) -> Result<Vec<String>, String> {
    let mut names: Vec<String> = Vec::new();
    for (k, across) in p.cross_sections.iter().enumerate() {
        let (label, name) = (&across.label, plain(&across.label));
        if name.is_empty() || names.contains(&name) {
            return Err(format!(
                "cross_sections[{k}].label: given '{label}'; expected a label that differs from the others in its letters (a to z) and \
                 digits, of which the names of results are made"
            ));
        }
        names.push(name);
    }
    Ok(names)
}

/// Writes the ply with its deviation and moments, and their distributions; the maps that show them.
fn fields(
    host: &Host,
    p: &Parameters,
    ply: &Ply,
    deviation: Option<Vec<f64>>,
    plots: &mut Plots,
) -> Result<Vec<Map>, StepError> {
    let spreads = spreads(host, p, ply, deviation)?;
    for spread in &spreads {
        spread.write(host, plots)?;
    }
    host.define_mesh(
        &ply.name,
        &ply.flat,
        4,
        &ply.cells,
        &CensusBody {
            ply: ply.name.clone(),
        },
    )?;
    host.begin_frame(0.0)?;
    host.write_points(&ply.name, &ply.points)?;
    host.write_field(&ply.name, On::Cells, "shear_angle", 1, "rad", &ply.shear)?;
    let mut maps = Vec::new();
    for s in &spreads {
        host.write_field(&ply.name, s.on, s.name, 1, s.unit, &s.values)?;
        maps.push(Map {
            name: s.name.into(),
            title: Some(s.title.into()),
            unit: s.shown.into(),
            panels: vec![Panel {
                label: ply.name.clone(),
                body: ply.name.clone(),
                field: s.name.into(),
            }],
        });
    }
    host.end_frame()?;
    Ok(maps)
}

/// The distributions of deviation and moments, where they are known.
fn spreads(
    host: &Host,
    p: &Parameters,
    ply: &Ply,
    deviation: Option<Vec<f64>>,
) -> Result<Vec<Spread>, StepError> {
    let topology = Topology::new(ply.flat.len(), 4, &ply.cells);
    let mut spreads = Vec::new();
    if let Some(values) = deviation {
        let weights = topology.node_areas(&ply.flat);
        if let Some(radius) = p.dome_radius {
            dome(host, p, ply, radius, (&values, &weights))?;
        }
        spreads.push(Spread {
            name: "deviation",
            title: "Deviation from punch and die",
            unit: "m",
            shown: "mm",
            on: On::Points,
            values,
            weights,
        });
    }
    if let Some((on, values)) = ply.moments.clone() {
        spreads.push(Spread {
            name: "bending_moment",
            title: "RMS bending moment along the fibres",
            unit: "N",
            shown: "N",
            weights: moments::weights(on, &topology, &ply.flat),
            on,
            values,
        });
    }
    Ok(spreads)
}

/// Deviation of what lies within a radius (m) of the axis. `values`: `[nodes]` (m), `weights`: areas that they stand for (m2).
fn dome(
    host: &Host,
    p: &Parameters,
    ply: &Ply,
    radius: f64,
    (values, weights): (&[f64], &[f64]),
) -> Result<(), StepError> {
    let within = |q: &Vec3| (q[0] - p.centre[0]).fixed_hypot(q[1] - p.centre[1]) <= radius;
    let weights: Vec<f64> = (ply.points.iter().zip(weights))
        .map(|(q, w)| if within(q) { *w } else { 0.0 })
        .collect();
    let largest = weighted_quantiles(values, &weights, &[1.0])[0];
    host.result("dome_deviation_mean", weighted_mean(values, &weights), "m")?;
    host.result("dome_deviation_largest", largest, "m")
}

fn results(host: &Host, waves: &[Wrinkle], inner: f64) -> Result<(), StepError> {
    let mean = |of: &dyn Fn(&Wrinkle) -> bool, what: fn(&Wrinkle) -> f64| {
        let values: Vec<f64> = waves.iter().filter(|w| of(w)).map(what).collect();
        values.iter().sum::<f64>() / values.len().max(1) as f64
    };
    let count = |of: &dyn Fn(&Wrinkle) -> bool| waves.iter().filter(|w| of(w)).count() as f64;
    host.result("wrinkles", count(&|_| true), "1")?;
    for k in 0..4 {
        let name = format!("wrinkles_q{}", k + 1);
        host.result(&name, count(&|w| w.quadrant() == k), "1")?;
    }
    host.result("height_mean", mean(&|_| true, |w| w.height.abs()), "m")?;
    let highest = waves.iter().map(|w| w.height.abs()).fold(0.0, f64::max);
    host.result("height_largest", highest, "m")?;
    host.result("width_mean", mean(&|_| true, |w| w.width), "m")?;
    host.result("length_mean", mean(&|_| true, |w| w.length), "m")?;
    for (sign, positive) in [("positive", true), ("negative", false)] {
        let of = move |w: &Wrinkle| (w.shear > 0.0) == positive;
        host.result(&format!("wrinkles_{sign}_shear"), count(&of), "1")?;
        host.result(&format!("width_{sign}_shear"), mean(&of, |w| w.width), "m")?;
        host.result(
            &format!("length_{sign}_shear"),
            mean(&of, |w| w.length),
            "m",
        )?;
    }
    for (name, what) in [
        ("width", (|w| w.width) as fn(&Wrinkle) -> f64),
        ("length", |w| w.length),
    ] {
        let of = |positive: bool| mean(&|w| (w.shear > 0.0) == positive, what);
        let (negative, positive) = (of(false), of(true));
        if negative > 0.0 && positive > 0.0 {
            let name = format!("negative_over_positive_{name}");
            host.result(&name, negative / positive, "1")?;
        }
    }
    host.result("inner_deviation", inner, "m")
}
