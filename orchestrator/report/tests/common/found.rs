//! What was found on the plies of the made-up study: detection, zones, comparison, measurement.

use super::Study;
use super::shapes::{HALF, RADIUS, plies};
use plyflow_artifact::{FieldInfo, On};
use serde_json::{Value, json};

/// Distance (m) of what hangs beside the tool, and from where on along x (m).
pub const BESIDE: [f64; 2] = [0.05, 0.058];

impl Study {
    pub fn defects(&mut self, flat_tool: bool) {
        let mut w = self.create("detect", "defects");
        let mut sheets = plies([-HALF[0], -HALF[1], HALF[0], HALF[1]], 0.004);
        for (name, s) in &sheets {
            w.define_mesh(name, &s.formed, 4, &s.cells, "").unwrap();
        }
        w.begin_frame(1.0).unwrap();
        for (name, s) in &mut sheets {
            let beside = |p: &[f64]| self.beside_tool && p[0] > BESIDE[1];
            let judged: Vec<bool> = s.flat.chunks(3).map(|p| !beside(p)).collect();
            for (d, judged) in s.distance.iter_mut().zip(&judged) {
                *d = if *judged { *d } else { BESIDE[0] };
            }
            let stands_off =
                |i: &u32| judged[*i as usize] && s.distance[*i as usize] > self.flagged_from;
            let high = |c: &[u32]| c.iter().any(stands_off) && !flat_tool;
            let flag: Vec<f64> = s
                .cells
                .chunks(4)
                .map(|c| f64::from(u8::from(high(c))))
                .collect();
            w.frame_points(name, &s.formed).unwrap();
            w.frame_field(
                name,
                FieldInfo::new(On::Cells, "shear_angle", 1, "rad"),
                &s.shear,
            )
            .unwrap();
            w.frame_field(
                name,
                FieldInfo::new(On::Points, "nodal_distance", 1, "m"),
                &s.distance,
            )
            .unwrap();
            let judged: Vec<f64> = judged.iter().map(|j| f64::from(u8::from(*j))).collect();
            w.frame_field(name, FieldInfo::new(On::Points, "judged", 1, "1"), &judged)
                .unwrap();
            w.frame_field(
                name,
                FieldInfo::new(On::Points, "curvature_max", 1, "1/m"),
                &s.curvature,
            )
            .unwrap();
            w.frame_field(name, FieldInfo::new(On::Cells, "flag", 1, "1"), &flag)
                .unwrap();
            w.frame_field(
                name,
                FieldInfo::new(On::Points, "undeformed", 3, "m"),
                &s.flat,
            )
            .unwrap();
        }
        w.end_frame().unwrap();
        let area = if flat_tool { 0.0 } else { 0.0018 };
        let share = if self.beside_tool { 0.74 } else { 1.0 };
        let ply = |name: &str| {
            json!({"name": name, "flagged_area": area, "over_shear_area": 0.0, "poor_conformity_area": area,
            "shear_min": -0.6, "shear_max": 0.4, "distance_max": 0.006, "judged_share": share})
        };
        let thresholds = json!({"over_shear_positive": 0.1396, "over_shear_negative": -0.8727, "distance_threshold": self.flagged_from, "foot_margin": 0.01});
        let attributes = json!({"thresholds": thresholds, "plies": [ply("ply_1"), ply("ply_2")]});
        w.attributes(&attributes.to_string()).unwrap();
        let results = vec![("flagged_area", 2.0 * area, "m2")];
        self.finish(
            w,
            ("detect", &[]),
            "defects",
            &[("formed", "coarse")],
            results,
        );
    }

    pub fn zones(&mut self, zones: &[(&str, [f64; 4])]) {
        self.zones_of("zones", &[("defects", "detect")], zones);
    }

    /// Zones by a step, from what arrives at its ports.
    pub fn zones_of(&mut self, step: &str, inputs: &[(&str, &str)], zones: &[(&str, [f64; 4])]) {
        let mut w = self.create(step, "zones");
        let list: Vec<Value> = zones
            .iter()
            .map(|(name, b)| {
                json!({"name": name, "box": b, "free_sides": [false, false, name == &"A", false],
                "plies": ["ply_1", "ply_2"], "flagged_area": 0.0009})
            })
            .collect();
        w.attributes(&json!({"zones": list, "scale": 1.15}).to_string())
            .unwrap();
        let results = vec![("zone_count", zones.len() as f64, "1")];
        self.finish(w, (step, &[]), "zones", inputs, results);
    }

    pub fn boundary(&mut self, zone: &str) {
        let label = format!("boundary[{zone}]");
        let mut w = self.create(&label, "boundary");
        w.attributes("{}").unwrap();
        let inputs = [("formed", "coarse"), ("zones", "zones")];
        self.finish(w, ("boundary", &[zone]), "boundary", &inputs, vec![]);
    }

    pub fn comparison(&mut self, zones: &[(&str, [f64; 4])]) {
        self.compared("compare", ["coarse", "local"], zones, &[]);
    }

    /// A comparison by a step, of a global run and of the local runs of a step, with what else arrives at its ports.
    pub fn compared(
        &mut self,
        step: &str,
        [global, local]: [&str; 2],
        zones: &[(&str, [f64; 4])],
        more: &[(&str, &str)],
    ) {
        let mut w = self.create(step, "comparison");
        let mut defects = Vec::new();
        let of_model = |name: &str, role: &str, zone: Option<&str>| json!({"name": name, "role": role, "zone": zone, "element_size": 0.004, "elements": 1000, "element_cycles": 4e7});
        let mut models = vec![of_model("global", "global", None)];
        for (zone, bounds) in zones {
            let model = format!("local.{zone}");
            models.push(of_model(&model, "local", Some(zone)));
            let (cx, cy) = ((bounds[0] + bounds[2]) / 2.0, (bounds[1] + bounds[3]) / 2.0);
            let defect = |model: &str, ply: &str, id: String, kind: &str, length: f64| {
                json!({"id": id, "model": model, "zone": zone, "ply": ply, "type": kind, "length": length, "amplitude": 0.0052,
                    "area": 4.1e-4, "centre": [cx, cy], "curvature_max": 171.0, "radius": 1.0 / 171.0, "direction": if kind == "wrinkle" { json!(-0.5) } else { Value::Null },
                    "cause": if kind == "wrinkle" { json!("bridging") } else { Value::Null }, "ridge_shear": 0.05, "ridge_shear_min": 0.02, "ridge_shear_max": 0.09, "shear_min": -0.2, "shear_max": 0.31, "touches_cut": zone == &"B",
                    "cut_sides": [zone == &"B", false, false, false]})
            };
            defects.push(defect(
                &model,
                "ply_2",
                format!("{zone}W1"),
                "wrinkle",
                0.0684,
            ));
            defects.push(defect(
                "global",
                "ply_2",
                format!("{zone}W1"),
                "wrinkle",
                0.0523,
            ));
            defects.push(defect(
                &model,
                "ply_1",
                format!("{zone}B1"),
                "bridging",
                0.02,
            ));
        }
        for (zone, bounds) in zones {
            for (name, s) in plies(*bounds, 0.002) {
                let about = json!({"model": format!("local.{zone}"), "ply": name}).to_string();
                w.define_mesh(
                    &format!("local_{zone}_{name}"),
                    &s.formed,
                    4,
                    &s.cells,
                    &about,
                )
                .unwrap();
            }
        }
        // An artifact without bodies has no frame.
        if !zones.is_empty() {
            w.begin_frame(0.0).unwrap();
        }
        for (zone, bounds) in zones {
            for (name, s) in plies(*bounds, 0.002) {
                let body = format!("local_{zone}_{name}");
                let defect: Vec<f64> = s
                    .distance
                    .iter()
                    .map(|d| f64::from(u8::from(*d > 0.002)))
                    .collect();
                w.frame_points(&body, &s.formed).unwrap();
                w.frame_field(
                    &body,
                    FieldInfo::new(On::Points, "nodal_distance", 1, "m"),
                    &s.distance,
                )
                .unwrap();
                w.frame_field(
                    &body,
                    FieldInfo::new(On::Points, "curvature_max", 1, "1/m"),
                    &s.curvature,
                )
                .unwrap();
                w.frame_field(&body, FieldInfo::new(On::Points, "defect", 1, "1"), &defect)
                    .unwrap();
                w.frame_field(
                    &body,
                    FieldInfo::new(On::Points, "undeformed", 3, "m"),
                    &s.flat,
                )
                .unwrap();
                w.frame_field(
                    &body,
                    FieldInfo::new(On::Cells, "shear_angle", 1, "rad"),
                    &s.shear,
                )
                .unwrap();
            }
        }
        if !zones.is_empty() {
            w.end_frame().unwrap();
        }
        w.attributes(&json!({"models": models, "defects": defects}).to_string())
            .unwrap();
        let locals: Vec<String> = (zones.iter())
            .map(|z| format!("{local}[{}]", z.0))
            .collect();
        let mut inputs = vec![("global", global), ("zones", "zones")];
        inputs.extend(more);
        inputs.extend(locals.iter().map(|l| ("local", l.as_str())));
        let results = vec![("wrinkle_count", zones.len() as f64, "1")];
        self.finish(w, (step, &[]), "comparison", &inputs, results);
    }

    /// Defects measured on the coarse run: on ply_2 two wrinkles, the first with its crest.
    pub fn measurement(&mut self) {
        self.measurement_by("measure", 0.0052);
    }

    /// The same by another step, by how high the wrinkles are (m).
    pub fn measurement_by(&mut self, step: &str, height: f64) {
        let mut w = self.create(step, "measurement");
        let sheets = plies([-HALF[0], -HALF[1], HALF[0], HALF[1]], 0.004);
        for (name, s) in &sheets {
            w.define_mesh(name, &s.flat, 4, &s.cells, "").unwrap();
        }
        w.begin_frame(1.0).unwrap();
        for (name, s) in &sheets {
            let number = |(i, d): (usize, &f64)| match (*d > 0.002, s.flat[3 * i] < 0.0) {
                (true, true) => 1.0,
                (true, false) => 2.0,
                _ => 0.0,
            };
            let defect: Vec<f64> = s.distance.iter().enumerate().map(number).collect();
            w.frame_points(name, &s.formed).unwrap();
            w.frame_field(name, FieldInfo::new(On::Points, "defect", 1, "1"), &defect)
                .unwrap();
            if *name == "ply_2" {
                let along: Vec<f64> = s.flat.chunks_exact(3).map(|p| 0.01 * p[1]).collect();
                w.frame_field(
                    name,
                    FieldInfo::new(On::Points, "slip_along", 1, "m"),
                    &along,
                )
                .unwrap();
            }
        }
        w.end_frame().unwrap();
        let r = RADIUS + 0.008;
        let ridge: Vec<[f64; 3]> = (0..9)
            .map(|k| (-0.055 + 0.0025 * f64::from(k)) / RADIUS)
            .map(|a| [-0.05, r * a.sin(), r * a.cos()])
            .collect();
        let defect = |number: u32, ridge: &[[f64; 3]]| {
            json!({"on": "ply_2", "number": number, "type": "wrinkle", "length": 0.021, "amplitude": height, "area": 4.1e-4,
            "centre": [0.0, 0.0], "ridge": ridge})
        };
        let columns = [
            json!({"label": "defect"}),
            json!({"label": "length", "unit": "m"}),
        ];
        let table = json!({"name": "defects", "title": "Measured defects", "columns": columns,
            "rows": [["1", 0.021], ["2", 0.018]]});
        let about = json!({"defects": [defect(1, &ridge), defect(2, &[])], "tables": [table]});
        w.attributes(&about.to_string()).unwrap();
        let inputs = [("formed", "coarse")];
        let results = vec![("wrinkle_count", 2.0, "1")];
        self.finish(w, (step, &[]), "measurement", &inputs, results);
    }
}
