//! Made-up studies of many points, each with a formed ply.

use super::shapes::{HALF, wavy};
use super::{Study, key};
use camino::Utf8Path;
use plyflow_artifact::{FieldInfo, On};
use plyflow_report::{
    Family, Fate, Origin, Point, ReportInput, Response, Sampled, Value, Variable,
};
use serde_json::json;

/// What comes out at a point.
pub enum Out {
    /// A value for each response, and how wavy the ply is.
    Values(Vec<Option<f64>>, f64),
    /// Class and cause.
    Failed(&'static str, &'static str),
    NotRun,
}

/// What is varied and what is read, with their units.
pub struct About<'a> {
    pub variables: &'a [(&'a str, &'a str)],
    pub responses: &'a [(&'a str, &'a str)],
    /// Whether points have plies, of which pictures can be drawn.
    pub plies: bool,
}

/// All combinations of numbers.
pub fn grid(values: &[&[f64]]) -> Vec<Vec<Value>> {
    let mut all = vec![Vec::new()];
    for column in values {
        all = all
            .iter()
            .flat_map(|row: &Vec<Value>| {
                column.iter().map(|v| {
                    let mut row = row.clone();
                    row.push(Value::Number(*v));
                    row
                })
            })
            .collect();
    }
    all
}

/// Numbers that fill the unit cube evenly (R-sequence of Roberts), each rounded to four digits.
pub fn spread(n: usize, d: usize) -> Vec<Vec<f64>> {
    let g = [1.618_033_988_75, 1.324_717_957_24, 1.220_744_084_61][d - 1];
    let at = |i: usize, k: usize| {
        let v: f64 = 0.5 + (i + 1) as f64 / f64::powi(g, k as i32 + 1);
        (v.fract() * 1e4).round() / 1e4
    };
    (0..n).map(|i| (0..d).map(|k| at(i, k)).collect()).collect()
}

pub fn number(v: &Value) -> f64 {
    match v {
        Value::Number(v) => *v,
        _ => f64::NAN,
    }
}

fn text(v: &Value) -> String {
    match v {
        Value::Number(v) => v.to_string(),
        Value::Text(t) => t.clone(),
        Value::Flag(b) => b.to_string(),
    }
}

/// A study of these points.
pub fn family(
    folder: &Utf8Path,
    about: &About<'_>,
    rows: Vec<Vec<Value>>,
    out: impl Fn(&[Value]) -> Out,
) -> ReportInput {
    let mut study = Study::new(folder);
    let w = study.create("table", "plain");
    study.finish(w, ("table", &[]), "plain", &[], vec![("rows", 3.0, "1")]);
    let mut points = Vec::new();
    for values in rows {
        let named = about.variables.iter().zip(&values);
        let named: Vec<String> = named
            .map(|((n, u), v)| format!("{n}={}{u}", text(v)))
            .collect();
        let name = named.join(",");
        let step = format!("formed@{name}");
        let (responses, fate, wave) = match out(&values) {
            Out::Values(all, wave) => (all, Fate::Done, Some(wave)),
            Out::Failed(class, cause) => {
                let fate = Fate::Failed {
                    step: step.clone(),
                    class: class.into(),
                    cause: cause.into(),
                };
                (vec![None; about.responses.len()], fate, None)
            }
            Out::NotRun => (vec![None; about.responses.len()], Fate::NotRun, None),
        };
        let mut instances = vec![0];
        if let Some(wave) = wave {
            instances.push(study.instances.len());
            let label = key(&name)[..24.min(2 * name.len())].to_owned() + &points.len().to_string();
            ply(&mut study, &label, &step, wave, about.plies);
        }
        points.push(Point {
            word: format!("'{name}'"),
            name,
            values,
            responses,
            fate,
            instances,
            report: None,
        });
    }
    let family = Family {
        variables: (about.variables.iter())
            .map(|(n, u)| Variable {
                name: (*n).into(),
                unit: (*u).into(),
            })
            .collect(),
        responses: (about.responses.iter())
            .map(|(n, u)| Response {
                name: (*n).into(),
                unit: (*u).into(),
                from: Origin::Step {
                    step: "formed".into(),
                    result: format!("{n}_max"),
                },
            })
            .collect(),
        points,
        samples: Vec::new(),
        table: "study.csv".into(),
        shared: vec![0],
    };
    ReportInput {
        workflow: "made-up <study>".into(),
        expectations: vec![],
        family: Some(family),
        ..study.input()
    }
}

/// A forming run with one ply.
fn ply(study: &mut Study, label: &str, step: &str, wave: f64, with_ply: bool) {
    let mut w = study.create(label, if with_ply { "forming" } else { "plain" });
    if with_ply {
        let s = wavy([-HALF[0], -HALF[1], HALF[0], HALF[1]], 0.004, 0.001, wave);
        w.define_mesh("ply_1", &s.flat, 4, &s.cells, "").unwrap();
        w.begin_frame(1.0).unwrap();
        w.frame_points("ply_1", &s.formed).unwrap();
        let shear: Vec<f64> = s.shear.iter().map(|v| v * (0.5 + wave)).collect();
        w.frame_field(
            "ply_1",
            FieldInfo::new(On::Cells, "shear_angle", 1, "rad"),
            &shear,
        )
        .unwrap();
        w.end_frame().unwrap();
        let attributes = json!({"sheets": [{"name": "ply_1", "kind": "ply", "thickness": 0.0004, "offset": 0.0002}], "zone": null, "element_size": 0.004,
            "warnings": if wave > 1.4 { json!(["the ply <folds>"]) } else { json!([]) }});
        w.attributes(&attributes.to_string()).unwrap();
    }
    let kind = if with_ply { "forming" } else { "plain" };
    study.finish(w, (step, &[]), kind, &[], vec![("length", wave, "m")]);
    if let Some(last) = study.instances.last_mut() {
        last.artifact = study.folder.join(format!("{label}.h5"));
    }
}

const MAP: About<'static> = About {
    variables: &[
        ("layup", ""),
        ("fabric_fabric", ""),
        ("fabric_diaphragm", ""),
    ],
    responses: &[("length", "m"), ("shear", "rad")],
    plies: true,
};

/// Two layups by 13 by 8 frictions, with a threshold and some failed points: 208 points.
pub fn friction_map(folder: &Utf8Path) -> ReportInput {
    let steps = |n: usize| -> Vec<f64> {
        (1..=n)
            .map(|i| (0.025 * i as f64 * 1e4).round() / 1e4)
            .collect()
    };
    let mut rows = Vec::new();
    for layup in ["L3", "L4"] {
        for row in grid(&[&steps(13), &steps(8)]) {
            rows.push([vec![Value::Text(layup.into())], row].concat());
        }
    }
    family(folder, &MAP, rows, |v| {
        let (a, b) = (number(&v[1]), number(&v[2]));
        let start = if v[0] == Value::Text("L3".into()) {
            0.125
        } else {
            0.075
        };
        let length = (0.6 * (a - start) + 0.1 * b * (a - start)).clamp(0.0, 0.11);
        match (a > 0.24, b > 0.17) {
            (true, true) => Out::Failed(
                "error",
                "the time step fell below its floor: a ply is folded at (0.1, 0.02) <sharp>",
            ),
            _ if a == 0.1 && b == 0.1 => Out::Failed("time-limit", "the time limit of 4 h ran out"),
            _ if a == 0.325 => Out::NotRun,
            _ => Out::Values(vec![Some(length), Some(0.2 + a)], 14.0 * length),
        }
    })
}

const SWEEP: About<'static> = About {
    variables: &[("angle", "deg")],
    responses: &[("length", "m"), ("shear", "rad"), ("count", "1")],
    plies: true,
};

/// An angle from 0 to 90 degrees by `by`: a hump.
pub fn sweep(folder: &Utf8Path, by: usize) -> ReportInput {
    let angles: Vec<f64> = (0..=90).step_by(by).map(|a| a as f64).collect();
    family(folder, &SWEEP, grid(&[&angles]), |v| {
        let angle = number(&v[0]);
        let length = (0.4 * ((angle - 20.0) * (70.0 - angle) / 625.0)).max(0.0);
        if angle == 60.0 {
            return Out::Failed("crash", "signal 11 in the step");
        }
        Out::Values(
            vec![Some(length), Some(0.5 - 0.004 * angle), None],
            3.0 * length,
        )
    })
}

const SAMPLE: About<'static> = About {
    variables: &[("bending", "N mm"), ("friction", ""), ("pressure", "kPa")],
    responses: &[("length", "m")],
    plies: false,
};

/// A sample of three variables without plies.
pub fn sample(folder: &Utf8Path, n: usize) -> ReportInput {
    let rows = spread(n, 3).into_iter().map(|u| {
        let bending = (10f64.powf(2.0 * u[0]) * 1e3).round() / 1e3;
        vec![
            Value::Number(bending),
            Value::Number(0.4 * u[1]),
            Value::Number(20.0 + 80.0 * u[2]),
        ]
    });
    let mut input = family(folder, &SAMPLE, rows.collect(), |v| {
        let [a, b, c] = [0, 1, 2].map(|i| number(&v[i]));
        if b > 0.395 {
            return Out::Failed("error", "it did not come to rest");
        }
        Out::Values(vec![Some(0.05 * b + 0.002 * a.log10() + 4e-8 * c)], 0.0)
    });
    if let Some(family) = &mut input.family {
        family.samples = vec![Sampled {
            method: "sobol".into(),
            count: n as u32,
            seed: 7,
        }];
    }
    input
}

/// One point alone.
pub fn alone(folder: &Utf8Path) -> ReportInput {
    family(folder, &SWEEP, grid(&[&[45.0]]), |_| {
        Out::Values(vec![Some(0.1), Some(0.2), None], 1.0)
    })
}

/// Texts and flags, with a factor that makes three points of each.
pub fn texts(folder: &Utf8Path) -> ReportInput {
    let about = About {
        variables: &[("fabric", ""), ("lubricated", ""), ("seed", "")],
        responses: &[("length", "m")],
        plies: true,
    };
    let mut rows = Vec::new();
    for fabric in ["biax <300>", "twill"] {
        for lubricated in [false, true] {
            for seed in [1.0, 2.0, 3.0] {
                rows.push(vec![
                    Value::Text(fabric.into()),
                    Value::Flag(lubricated),
                    Value::Number(seed),
                ]);
            }
        }
    }
    family(folder, &about, rows, |v| {
        let base = if v[1] == Value::Flag(true) { 0.0 } else { 0.08 };
        let more = if v[0] == Value::Text("twill".into()) {
            0.03
        } else {
            0.0
        };
        let length = base + more + 0.004 * (number(&v[2]) * 2.1).sin();
        Out::Values(vec![Some(length)], 10.0 * length)
    })
}
