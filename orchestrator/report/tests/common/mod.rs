//! A made-up study: two plies bent over a cylinder along x, wavy in two zones.
#![allow(dead_code, missing_docs)]

mod extras;
pub mod family;
pub mod found;
mod labels;
mod shapes;

use camino::{Utf8Path, Utf8PathBuf};
use extras::{further_fields, history};
use labels::{as_refs, key, label_of, split};
use plyflow_artifact::{ArtifactWriter, DType, FieldInfo, On};
use plyflow_model::job::{Cost, NamedResult, Record};
use plyflow_report::{Expectation, Instance, ReportInput};
use serde_json::{Value, json};
use shapes::{HALF, plies, sheet, tool};
use std::f64::consts::FRAC_PI_4;

/// A scene as artifacts have it: resolved, with its materials.
pub fn scene() -> Value {
    let fabric = json!({"plyflow_material": 1, "name": "Made-up fabric", "source": "nobody <knows>", "plugin": "material-fabric",
        "thickness": "0.0004 m", "areal_mass": "0.44 kg/m2",
        "with": {"fibre_modulus": 3e9, "shear": {"coefficients": [0.0, 112.0, 94.0]}, "bending": {"positive": {"stiffness": 4e-4}}}});
    let film = json!({"plyflow_material": 1, "name": "Another law", "plugin": "somebody-s", "thickness": "8e-5 m", "areal_mass": "0.08 kg/m2",
        "with": {"modulus": 12.5}});
    let sheet =
        |name: &str, material: &Value| json!({"name": name, "kind": "ply", "material": material});
    json!({
        "plyflow_scene": 1, "name": "half-pipe",
        "tool": {"hemisphere": {"radius": "0.06 m", "facet_size": "0.004 m"}},
        "sheets": [sheet("ply_1", &fabric), sheet("ply_2", &film)],
        "friction": {"fabric_fabric": 0.35, "tool_fabric": {"coefficient": 0.2, "pressure": {"power": {"reference": "10000 Pa", "exponent": -0.1}}}},
        "process": {"double_diaphragm": {"bag_pressure": "100000 Pa", "bagging_time": "0.08 s", "clearance": "0.005 m", "drawing_time": "0.4 s",
            "film_joint_margin": "0.03 m", "film_pre_stretch": 0.01, "forming_pressure": "90000 Pa", "frame_length": "1.8 m", "frame_width": "1.5 m",
            "lowering_time": "0.3 s", "settling_time": "0.04 s"}},
    })
}

pub struct Study {
    pub folder: Utf8PathBuf,
    pub instances: Vec<Instance>,
    /// What the forming runs that follow tell of themselves.
    pub kinetic_bound_kept: bool,
    /// Whether they are of a press.
    pub press: bool,
    /// Whether they are of a stamping: its parts, and what each presses with at the end (N).
    pub parts: Vec<(&'static str, f64)>,
    /// Whether what the detection looks at reaches past the tool: there it judges no distance.
    pub beside_tool: bool,
    /// The scene that they had; null: an artifact that tells none.
    pub scene: Value,
    /// Further parameters of the steps that follow.
    pub parameters: Value,
    /// Whether the forming runs that follow are drapes by geometry, which reach half of the plies.
    pub half_draped: bool,
    /// The same, which reach all of them.
    pub draped: bool,
    /// Distance (m) from which on what stands off is flagged.
    pub flagged_from: f64,
}

impl Study {
    pub fn new(folder: &Utf8Path) -> Self {
        Self {
            folder: folder.to_owned(),
            instances: Vec::new(),
            kinetic_bound_kept: true,
            press: false,
            parts: Vec::new(),
            beside_tool: false,
            scene: scene(),
            parameters: json!({}),
            half_draped: false,
            draped: false,
            flagged_from: 0.001,
        }
    }

    /// Ends an artifact and lists its instance.
    pub fn finish(
        &mut self,
        w: ArtifactWriter,
        (step, item): (&str, &[&str]),
        kind: &str,
        inputs: &[(&str, &str)],
        results: Vec<(&str, f64, &str)>,
    ) {
        let named = |(name, value, unit): (&str, f64, &str)| NamedResult {
            name: name.into(),
            value,
            unit: unit.into(),
            measured: false,
        };
        let wires: Vec<Value> = (inputs.iter())
            .map(|(port, from)| json!({"port": port, "step": from, "item": [], "key": key(from)}))
            .collect();
        let mut parameters = json!({"kinetic_bound": 0.05, "note": "a < b & \"c\""});
        if kind == "forming" && !self.scene.is_null() {
            parameters["scene"] = self.scene.clone();
        }
        for (key, value) in self.parameters.as_object().unwrap() {
            parameters[key] = value.clone();
        }
        let plugin = json!({"name": kind, "version": "0.1.0", "hash": "feed".repeat(16)});
        let bytes = w.finish(&json!({
            "step": step, "plugin": plugin, "components": [plugin], "parameters": parameters, "inputs": wires,
        }));
        let label = if item.is_empty() {
            step.into()
        } else {
            format!("{step}[{}]", item.join(","))
        };
        let n = self.instances.len() as f64;
        self.instances.push(Instance {
            step: step.into(),
            item: item.iter().map(|i| (*i).to_owned()).collect(),
            artifact: self.path(&label),
            record: Record {
                version: 1,
                step: step.into(),
                item: vec![],
                key: key(&label),
                kind: kind.into(),
                bytes: bytes.unwrap(),
                hash: String::new(),
                cost: Cost {
                    wall_seconds: 12.5 + n,
                    cpu_seconds: 24.0 + 9.0 * n,
                    peak_memory: 300 << 20,
                    threads: 2,
                },
                results: results.into_iter().map(named).collect(),
                collection: None,
                warnings: vec![],
                host: "bench".into(),
                started: 0.0,
            },
        });
    }

    pub fn path(&self, label: &str) -> Utf8PathBuf {
        self.folder.join(format!("{label}.h5"))
    }

    pub fn create(&self, label: &str, kind: &str) -> ArtifactWriter {
        ArtifactWriter::create(self.path(label).as_std_path(), kind).unwrap()
    }

    /// A forming run; local when it has a zone.
    pub fn forming(&mut self, label: &str, zone: Option<(&str, [f64; 4])>, size: f64) {
        let (step, item) = split(label);
        let mut w = self.create(label, "forming");
        let sheets = plies(
            zone.map_or([-HALF[0], -HALF[1], HALF[0], HALF[1]], |z| z.1),
            size,
        );
        for (name, s) in &sheets {
            w.define_mesh(name, &s.flat, 4, &s.cells, "").unwrap();
        }
        let (points, cells) = tool();
        w.define_mesh("tool", &points, 3, &cells, "").unwrap();
        for (t, last) in [(0.0, false), (1.0, true)] {
            w.begin_frame(t).unwrap();
            for (name, s) in &sheets {
                w.frame_points(name, if last { &s.formed } else { &s.flat })
                    .unwrap();
                w.frame_field(
                    name,
                    FieldInfo::new(On::Cells, "shear_angle", 1, "rad"),
                    &s.shear,
                )
                .unwrap();
                further_fields(&mut w, name, s, last);
                if self.half_draped {
                    let right = |c: &[u32]| s.flat[3 * c[0] as usize] > 0.0;
                    let draped: Vec<f64> = (s.cells.chunks(4))
                        .map(|c| f64::from(u8::from(right(c))))
                        .collect();
                    let field = FieldInfo::new(On::Cells, "draped", 1, "1");
                    w.frame_field(name, field, &draped).unwrap();
                }
            }
            w.end_frame().unwrap();
        }
        history(&mut w, self.press, &self.parts);
        let elements: usize = sheets.iter().map(|(_, s)| s.cells.len() / 4).sum();
        let zone_json = zone.map_or(Value::Null, |(name, b)| json!({"name": name, "box": b, "free_sides": [false, false, name == "A", false]}));
        let list: Vec<Value> = sheets
            .iter()
            .map(|(n, _)| {
                let [x, y] = HALF;
                json!({"name": n, "kind": "ply", "thickness": 0.0004, "offset": 0.001, "material": "Made-up fabric", "areal_mass": 0.44,
                    "fibre_1": -FRAC_PI_4, "fibre_2": FRAC_PI_4, "outline": [[-x, -y], [x, -y], [x, y], [-x, y]]})
            })
            .collect();
        let mut attributes = json!({
            "scene": "half-pipe", "sheets": list, "element_size": size, "zone": zone_json, "cycles": 40000,
            "elements": elements, "element_cycles": 4e4 * elements as f64,
            "energy": {"peak_drift_ratio": 0.011, "peak_kinetic_ratio": 0.023, "kinetic_bound_kept": self.kinetic_bound_kept, "hourglass_ratio": 0.002},
            "penetration": {
                "tool/ply_1": {
                    "max": 2.1e-4, "q999": 8e-5, "overlap": 0.0421,
                    "peak": {"max": 3.3e-4, "max_time": 0.1875, "q999": 2.2e-4, "q999_time": 0.125, "overlap": 0.1153},
                },
                "ply_1/ply_2": {"max": 1e-4, "q999": 6e-5},
            },
            "overlap_bound": 0.1,
            "depth": {
                "tool/ply_1": {
                    "end": 6e-5, "share": 0.15, "bound": 4e-5, "place": [0.0123, 0.0, 0.02],
                    "peak": {"depth": 9e-5, "time": 0.1875, "place": [0.0124, 0.0, 0.02], "share": 0.225},
                },
                "between_nodes/ply_1/film": {"end": 5e-4, "share": 6.25, "peak": {"depth": 6e-4, "time": 0.5, "share": 7.5}},
            },
            "warnings": if zone.is_none() { json!(["the film <upper> is stretched by 61 %"]) } else { json!([]) },
        });
        if self.draped || self.half_draped {
            attributes["net_spacing"] = json!(0.002);
        }
        w.attributes(&attributes.to_string()).unwrap();
        let input = zone.map(|(name, _)| format!("boundary[{name}]"));
        let inputs: Vec<(&str, &str)> = input.iter().map(|l| ("boundary", l.as_str())).collect();
        let results = vec![
            ("kinetic_ratio", 0.023, "1"),
            ("penetration_max", 2.1e-4, "m"),
        ];
        self.finish(w, (&step, &as_refs(&item)), "forming", &inputs, results);
    }

    /// An artifact of a kind that this crate does not know.
    pub fn stranger(&mut self) {
        let mut w = self.create("coupon", "coupon-test");
        w.array("curve/force", DType::F64, &[2], "N", &[0; 16])
            .unwrap();
        w.attributes("{\"operator\": \"<b>me</b>\"}").unwrap();
        self.finish(
            w,
            ("coupon", &[]),
            "coupon-test",
            &[],
            vec![("modulus", 3.2e9, "Pa")],
        );
    }

    /// An artifact of any kind with arrays of one index (path, unit, values).
    pub fn artifact(
        &mut self,
        (step, item): (&str, &[&str]),
        kind: &str,
        arrays: &[(&str, &str, Vec<f64>)],
        attributes: &Value,
        results: Vec<(&str, f64, &str)>,
    ) {
        let label = label_of(step, item);
        let mut w = self.create(&label, kind);
        for (path, unit, values) in arrays {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
            let n = values.len() as u64;
            w.array(path, DType::F64, &[n], unit, &bytes).unwrap();
        }
        w.attributes(&attributes.to_string()).unwrap();
        self.finish(w, (step, item), kind, &[], results);
    }

    /// A picture frame: a wavy sheet, curves against a closed form and points, histories, numbers.
    pub fn coupon(&mut self) {
        let mut w = self.create("frame", "coupon");
        let s = sheet([-0.1, -0.1, 0.1, 0.1], 0.005, 0.0);
        w.define_mesh("fabric", &s.flat, 4, &s.cells, "{}").unwrap();
        w.begin_frame(1.0).unwrap();
        let mut bent = s.flat.clone();
        for p in bent.as_chunks_mut::<3>().0 {
            p[2] = 0.004 * (40.0 * p[0]).sin() * (30.0 * p[1]).cos();
        }
        w.frame_points("fabric", &bent).unwrap();
        w.frame_field(
            "fabric",
            FieldInfo::new(On::Cells, "shear_angle", 1, "rad"),
            &s.shear,
        )
        .unwrap();
        w.end_frame().unwrap();
        let angle: Vec<f64> = (0..=400)
            .map(|i| f64::from(i - 200) * 0.8 / 200.0)
            .collect();
        let force = |g: &f64| 100.0 * g + 300.0 * g.powi(3);
        let run: Vec<f64> = angle
            .iter()
            .map(|g| force(g) + 2.0 * (60.0 * g).sin())
            .collect();
        let exact: Vec<f64> = angle.iter().map(force).collect();
        let few: Vec<f64> = angle.iter().step_by(40).copied().collect();
        let told: Vec<f64> = few.iter().map(|g| 1.03 * force(g)).collect();
        for (path, unit, values) in [
            ("curves/run/shear_angle", "rad", &angle),
            ("curves/run/force", "N", &run),
            ("curves/closed_form/force", "N", &exact),
            ("curves/thesis/shear_angle", "rad", &few),
            ("curves/thesis/force", "N", &told),
        ] {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
            let n = values.len() as u64;
            w.array(path, DType::F64, &[n], unit, &bytes).unwrap();
        }
        history(&mut w, false, &[]);
        let energy = json!({"peak_drift_ratio": 0.004, "hourglass_ratio": 0.0123});
        w.attributes(
            &json!({
                "title": "Picture frame, \"NCF\" <both signs>",
                "energy": energy, "elements": 1600, "cycles": 5000,
                "plots": [{
                    "name": "force", "title": "Cross-head force",
                    "x": {"label": "shear angle", "unit": "deg"}, "y": {"label": "force", "unit": "N"},
                    "series": [
                        {"label": "this run", "x": "curves/run/shear_angle", "y": "curves/run/force", "style": "line"},
                        {"label": "closed form", "x": "curves/run/shear_angle", "y": "curves/closed_form/force", "style": "dashed"},
                        {"label": "thesis", "x": "curves/thesis/shear_angle", "y": "curves/thesis/force", "style": "points"},
                    ],
                }],
                "files": [{"name": "material.yaml", "text": "plyflow_material: 1\nname: <NCF>\n"}],
            })
            .to_string(),
        )
        .unwrap();
        let results = vec![("force_error", 0.0123, "1"), ("wrinkle_onset", 0.14, "rad")];
        self.finish(w, ("frame", &[]), "coupon", &[], results);
    }

    pub fn input(self) -> ReportInput {
        ReportInput {
            workflow: "half-pipe <demo> & co".into(),
            description: Some("Two plies over a \"cylinder\" <tool>".into()),
            file: "workflow.yaml".into(),
            given: "workflow.yaml --set 'coarse.element=m4 & <x>'".into(),
            program: "plyflow 0.1.0".into(),
            fingerprint: "0123abcd".into(),
            limits: None,
            judged: vec![],
            expectations: vec![
                expectation("zones", "zone_count", Some(2.0), "1", true),
                expectation("coarse", "penetration_max", Some(2.1e-4), "m", false),
                expectation("coarse", "no_such", None, "", false),
            ],
            instances: self.instances,
            failures: vec![],
            not_run: 0,
            family: None,
            until: Vec::new(),
        }
    }
}

pub fn expectation(
    step: &str,
    result: &str,
    got: Option<f64>,
    unit: &str,
    met: bool,
) -> Expectation {
    Expectation {
        step: step.into(),
        item: vec![],
        result: result.into(),
        unit: unit.into(),
        got,
        value: None,
        tolerance: None,
        minimum: met.then_some(1.0),
        maximum: (!met).then_some(2e-4),
        source: Some("thesis 5.5 <table>".into()),
        met,
    }
}

pub const ZONES: [(&str, [f64; 4]); 2] = [
    ("A", [-0.10, -0.08, -0.004, -0.012]),
    ("B", [0.02, 0.0, 0.1, 0.06]),
];

/// The whole way: coarse run, detection, zones, local runs, comparison.
pub fn whole(folder: &Utf8Path) -> ReportInput {
    whole_study(folder).input()
}

/// The same, before it is done.
pub fn whole_study(folder: &Utf8Path) -> Study {
    let mut s = Study::new(folder);
    s.forming("coarse", None, 0.004);
    s.defects(false);
    s.zones(&ZONES);
    for (zone, bounds) in ZONES {
        s.boundary(zone);
        s.forming(&format!("local[{zone}]"), Some((zone, bounds)), 0.002);
    }
    s.comparison(&ZONES);
    s
}
