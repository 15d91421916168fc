//! A catalog in memory and a sound study that tests mutate.
#![allow(dead_code)] // each test file uses its part

use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::manifest::{Manifest, PluginKind};
use plyflow_workflow::resolved::{PluginId, ResolvedStep, ResolvedWorkflow};
use plyflow_workflow::{Catalog, CatalogEntry, CatalogError, Diagnostics};

/// Plugins in memory.
pub struct Fake(pub Vec<Manifest>);

impl Catalog for Fake {
    fn find(&self, name: &str, relative_to: &Utf8Path) -> Result<CatalogEntry, CatalogError> {
        assert!(relative_to.is_absolute(), "{relative_to}");
        if name == "broken" {
            return Err(CatalogError::Broken {
                path: "/plugins/libbroken.so".into(),
                reason: "it speaks ABI 9.0, this program 1.0".into(),
            });
        }
        let wanted = name.rsplit('/').next().unwrap_or(name);
        let found = self.0.iter().find(|m| m.name == wanted);
        found
            .map(|manifest| CatalogEntry {
                id: PluginId {
                    name: manifest.name.clone(),
                    version: manifest.version.clone(),
                    path: format!("/plugins/lib{}.so", manifest.name).into(),
                    hash: blake3::hash(manifest.name.as_bytes()).to_hex().to_string(),
                },
                manifest: manifest.clone(),
            })
            .ok_or_else(|| CatalogError::NotFound {
                name: name.into(),
                searched: vec!["/plugins".into()],
            })
    }

    fn names(&self, kind: PluginKind) -> Vec<String> {
        self.0
            .iter()
            .filter(|m| m.kind == kind)
            .map(|m| m.name.clone())
            .collect()
    }
}

/// The plugins of the main workflow.
pub fn catalog() -> Fake {
    let texts = [
        r#"{"name": "forming-explicit", "version": "1", "kind": "step", "role": "forming", "summary": "s",
            "parameters": {
              "scene": {"type": "scene", "doc": "What is formed."},
              "element": {"type": "element", "required": true, "doc": "Formulation."},
              "element_size": {"type": "quantity", "dimension": "length", "default": "8 mm", "exclusive_minimum": "0 mm", "maximum": "1 m", "doc": "Edge."},
              "threads_hint": {"type": "integer", "minimum": 1, "maximum": 64, "doc": "Hint."},
              "damping": {"type": "number", "default": 0.1, "minimum": 0, "maximum": 1, "doc": "Fraction."},
              "label": {"type": "string", "doc": "Text."},
              "write_curvature": {"type": "boolean", "default": false, "doc": "Field."},
              "contact": {"type": "choice", "values": ["penalty", "kinematic"], "default": "penalty", "doc": "Method."},
              "probes": {"type": "list", "of": {"type": "object", "fields": {
                 "x": {"type": "quantity", "dimension": "length", "required": true}, "y": {"type": "quantity", "dimension": "length", "default": "0 mm"}}}, "doc": "Points."},
              "elements": {"type": "map", "of": {"type": "element"}, "doc": "By sheet."},
              "table": {"type": "file", "doc": "A table."},
              "curve": {"type": "list", "minimum_items": 2, "maximum_items": 4, "order": "increasing", "of": {"type": "quantity", "dimension": "angle"}, "doc": "A column."},
              "tables": {"type": "list", "of": {"type": "file"}, "doc": "Tables."}
            },
            "inputs": {"boundary": {"kind": "boundary", "required": false, "doc": "Driven edges."}},
            "output": {"kind": "forming"},
            "results": {"kinetic_ratio": {"unit": "1"}, "penetration": {"unit": "m"}}}"#,
        r#"{"name": "defect-detection", "version": "1", "kind": "step", "role": "defect-detection", "summary": "s",
            "parameters": {"over_shear_positive": {"type": "quantity", "dimension": "angle", "default": "8 deg", "minimum": "0 deg", "maximum": "90 deg", "doc": "Limit."}},
            "inputs": {"formed": {"kind": "forming", "doc": "Run."}}, "output": {"kind": "defects"}}"#,
        r#"{"name": "zone-extraction", "version": "1", "kind": "step", "role": "zone-extraction", "summary": "s",
            "inputs": {"defects": {"kind": "defects", "doc": "Flags."}}, "output": {"kind": "zones", "collection": true}}"#,
        r#"{"name": "boundary-interpolation", "version": "1", "kind": "step", "role": "boundary-interpolation", "summary": "s",
            "parameters": {"element_size": {"type": "quantity", "dimension": "length", "default": "3 mm"}},
            "inputs": {"formed": {"kind": "forming"}, "zones": {"kind": "zones"}}, "output": {"kind": "boundary"}}"#,
        r#"{"name": "comparison", "version": "1", "kind": "step", "role": "comparison", "summary": "s",
            "inputs": {"global": {"kind": "forming"}, "zones": {"kind": "zones"}, "defects": {"kind": "defects"}, "local": {"kind": "forming", "many": true, "required": false}},
            "output": {"kind": "comparison"},
            "results": {"zone_count": {"unit": ""}, "wrinkle_length": {"unit": "m"}}}"#,
        r#"{"name": "m4", "version": "1", "kind": "element", "role": "element", "summary": "s",
            "parameters": {"hourglass": {"type": "number", "default": 0.05, "minimum": 0}}}"#,
        r#"{"name": "rf4", "version": "1", "kind": "element", "role": "element", "summary": "s"}"#,
        r#"{"name": "material-fabric", "version": "1", "kind": "material", "role": "material", "summary": "s",
            "parameters": {"fibre_modulus": {"type": "quantity", "dimension": "pressure", "required": true, "exclusive_minimum": "0 Pa", "doc": "Along the fibres."},
                           "crossing": {"type": "quantity", "dimension": "angle", "doc": "From family 1 to family 2."},
                           "shear": {"type": "quantity", "dimension": "force_per_length", "default": "112.19 N/m"}}}"#,
        r#"{"name": "material-marlow", "version": "1", "kind": "material", "role": "material", "summary": "s",
            "parameters": {"modulus": {"type": "quantity", "dimension": "pressure", "default": "3 MPa"}}}"#,
    ];
    Fake(texts.iter().map(|t| Manifest::parse(t).unwrap()).collect())
}

pub const WORKFLOW: &str = r#"plyflow: 1
name: joggle-spar
description: The main job.
on_failure: keep-going
steps:
  coarse:
    plugin: forming-explicit
    with:
      scene: scene.yaml
      element: m4
      element_size: 8 mm
      contact: penalty
      damping: 0.1
    resources: {cores: 2, memory: 4 GiB, time_limit: 30 min}
    retries: 1
  defects:
    plugin: defect-detection
    from: coarse
    with:
      over_shear_positive: 8 deg
  zones: {plugin: zone-extraction, from: {defects: defects}}
  boundary:
    plugin: boundary-interpolation
    for_each: {zone: zones}
    from: {formed: coarse, zones: zones}
    with: {element_size: 3 mm}
  local:
    plugin: forming-explicit
    for_each: {zone: zones}
    from: {boundary: boundary}
    with: {scene: scene.yaml, element: rf4}
  comparison:
    plugin: comparison
    from:
      global: coarse
      zones: zones
      local: local
      defects: defects
expect:
  - {step: comparison, result: zone_count, minimum: 1, source: "thesis 5.5.2"}
  - {step: coarse, result: kinetic_ratio, maximum: 0.05}
  - {step: comparison, result: wrinkle_length.AW1, value: 68 mm, tolerance: 7 mm}
limits:
  wrinkle_height: 1 mm
  shear_negative: -50 deg
  places:
    - {ply: ply-1, rectangle: {length: 100 mm, width: 50 mm}, wrinkle_height: 2 mm}
"#;

pub const SCENE: &str = r#"plyflow_scene: 1
name: spar
tool:
  joggle_spar:
    length: 620 mm
    top_width: 80 mm
    height: 50 mm
    draft: 10 deg
    fillet: 10 mm
    joggles:
      - {start: -200 mm, length: 40 mm, rise: 10 mm, skew: 10 deg, side_step: [0 mm, 0 mm], fillet: 10 mm}
      - {start: 100 mm, length: 40 mm, rise: -10 mm, skew: 10 deg, side_step: [0 mm, 0 mm], fillet: 10 mm}
    facet_size: 5 mm
sheets:
  - name: lower-film
    kind: diaphragm
    material: film.yaml
  - name: ply-1
    kind: ply
    material: materials/fabric.yaml
    length: 480 mm
    width: 300 mm
    fibre_1: 45 deg
    fibre_2: -45 deg
  - name: upper-film
    kind: diaphragm
    material: film.yaml
friction:
  tool_diaphragm: 0.51
  fabric_diaphragm: 0.40
  fabric_fabric: 0.35
  diaphragm_diaphragm: 0.5
process:
  double_diaphragm:
    frame_length: 1.8 m
    frame_width: 1.5 m
    clearance: 5 mm
    bag_pressure: 1 bar
    forming_pressure: 1e5 Pa
    bagging_time: 5 ms
    lowering_time: 20 ms
    drawing_time: 20 ms
    settling_time: 5 ms
    film_joint_margin: 60 mm
"#;

pub const FABRIC: &str = r#"plyflow_material: 1
name: NCF
source: thesis 3.2
plugin: material-fabric
thickness: 0.4 mm
areal_mass: 440 g/m2
with:
  fibre_modulus: 3 GPa
  shear: 112.19 N/m
"#;

pub const FILM: &str = r#"plyflow_material: 1
name: film
plugin: material-marlow
thickness: 0.08 mm
areal_mass: 90 g/m2
"#;

pub const EXPECTED: &str = r#"{
  "plyflow_expected": 1,
  "source": "thesis 5.5.2",
  "expectations": [
    {"step": "comparison", "result": "zone_count", "minimum": 1},
    {
      "step": "comparison",
      "result": "wrinkle_length.AW1",
      "value": "68 mm",
      "tolerance": "7 mm",
      "source": "table 5.3"
    },
    {"step": "coarse", "result": "kinetic_ratio", "maximum": 5e-2}
  ]
}
"#;

/// A study on disk.
pub struct Study {
    folder: tempfile::TempDir,
}

impl Study {
    /// The sound study.
    pub fn sound() -> Study {
        let folder = tempfile::tempdir().unwrap();
        let study = Study { folder };
        std::fs::create_dir(study.path("materials")).unwrap();
        for (name, text) in [
            ("workflow.yaml", WORKFLOW),
            ("scene.yaml", SCENE),
            ("materials/fabric.yaml", FABRIC),
            ("film.yaml", FILM),
        ] {
            study.write(name, text);
        }
        study
    }

    /// The sound study with its expectations in a file of their own.
    pub fn with_expected_file() -> Study {
        let study = Study::sound();
        let at = WORKFLOW.find("expect:").unwrap();
        let workflow = format!("{}expect: expected.json\n", &WORKFLOW[..at]);
        study.write("workflow.yaml", &workflow);
        study.write("expected.json", EXPECTED);
        study
    }

    pub fn path(&self, name: &str) -> Utf8PathBuf {
        Utf8PathBuf::from_path_buf(self.folder.path().join(name)).unwrap()
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Replaces the first `from` by `to` and returns the line (from 1) where it stood.
    pub fn mutate(&self, name: &str, from: &str, to: &str) -> usize {
        let text = self.read(name);
        let at = text
            .find(from)
            .unwrap_or_else(|| panic!("no `{from}` in {name}"));
        self.write(name, &text.replacen(from, to, 1));
        text[..at].matches('\n').count() + 1
    }

    pub fn load(&self) -> Result<ResolvedWorkflow, Diagnostics> {
        plyflow_workflow::load(&self.path("workflow.yaml"), &catalog())
    }
}

/// A step by name.
pub fn step<'a>(w: &'a ResolvedWorkflow, name: &str) -> &'a ResolvedStep {
    w.steps.iter().find(|s| s.name == name).unwrap()
}
