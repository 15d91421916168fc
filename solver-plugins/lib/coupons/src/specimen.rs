//! A specimen: one sheet of a material, or some, meshed, with an element formulation.

use plyflow_abi::{PF_KIND_ELEMENT, PF_KIND_MATERIAL};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::component::{
    ElementField, ElementInstance, MaterialInstance, element_fields,
};
use plyflow_mechanics::crossed::Crossed;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::model::{Fixed, Model, StepSettings};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_model::budget::{self, Wanted};
use plyflow_model::material::Material;
use plyflow_model::steering::Laid;
use plyflow_sdk::{Host, StepError};
use serde::Deserialize;

/// A component choice as the host resolves it.
#[derive(Debug, Clone, Deserialize)]
pub struct ComponentChoice {
    /// Name or path of the plugin.
    pub plugin: String,
    /// Its resolved parameters.
    #[serde(default)]
    pub with: serde_json::Value,
}

/// The parameters that all coupon tests have (SI); put into the parameters of a test with
/// `#[serde(flatten)]`.
#[derive(Debug, Clone, Deserialize)]
pub struct Common {
    /// Material of the specimen.
    pub material: Material,
    /// Element formulation.
    pub element: ComponentChoice,
    /// Edge of the elements (m); 0 where the test says it otherwise.
    #[serde(default)]
    pub element_size: f64,
    /// How far nodes are off their places, over their shortest edges ([`crate::distortion`]); 0 where a test does not offer it.
    #[serde(default)]
    pub distortion: f64,
    /// Wanted step (s): elements below it are mass-scaled. Without it the natural step is used.
    #[serde(default)]
    pub time_step: Option<f64>,
    /// Share of the critical step that is used.
    pub step_safety: f64,
    /// Whether the test takes a fabric whose families do not cross at a right angle.
    #[serde(skip)]
    pub any_crossing: bool,
    /// Mass-proportional damping (1/s).
    #[serde(default)]
    pub damping: f64,
    /// Frames besides the start; unused by static tests, which write every state.
    #[serde(default)]
    pub frames: usize,
    /// Largest kinetic over internal energy of a quasi-static run; unused by static tests.
    #[serde(default)]
    pub kinetic_bound: f64,
}

impl Common {
    /// Thickness of the sheet (m).
    pub fn thickness(&self) -> f64 {
        self.material.thickness.si()
    }

    /// Whether a specimen of this area (m2) does not have too many elements to be made.
    ///
    /// # Errors
    /// Says how many there would be, and what size would do.
    pub fn allow(&self, area: f64) -> Result<(), StepError> {
        let size = self.element_size;
        let wanted = Wanted {
            what: "the mesh of the specimen",
            of: "elements",
            count: area / (size * size),
            most: budget::MOST_ELEMENTS,
            bytes: budget::ELEMENT_BYTES,
            parameter: "element_size",
            size,
        };
        Ok(budget::allow(wanted)?)
    }

    /// How the families of the material cross, where they do not at a right angle.
    ///
    /// # Errors
    /// When the test takes no such material.
    fn crossed(&self) -> Result<Option<Crossed>, StepError> {
        let crossing = self.material.crossing();
        let crossing = crossing.and_then(|p| Laid::Straight([0.0, p]).crossing());
        match crossing {
            Some(p) if !self.any_crossing => Err(format!(
                "material: given '{}', whose fibre families cross at {:.4} deg; expected one whose families cross at a right angle: this test has its \
                 specimen's sides, or its closed forms, along both. coupon-off-axis takes any",
                self.material.name,
                p.to_degrees()
            )
            .into()),
            other => Ok(other.map(Crossed::new)),
        }
    }

    /// Mass per area (kg/m2).
    pub fn areal_mass(&self) -> f64 {
        self.material.areal_mass.si()
    }
}

/// A sheet of a specimen of several.
pub struct Stacked {
    /// Its name in the model.
    pub name: &'static str,
    /// Its mesh, with node numbers of its own.
    pub mesh: QuadMesh,
    /// Direction of material axis e1 in the undeformed plane.
    pub axis: Vec3,
    /// Which of its faces a pressure acts on.
    pub pressed: Pressed,
}

/// A specimen as a model and as a body.
pub struct Specimen {
    /// The model; its sheets have the nodes of the mesh, in the same numbers.
    pub model: Model,
    /// The mesh at the start.
    pub mesh: QuadMesh,
    /// Fields of the element.
    pub fields: Vec<ElementField>,
    /// How the families of its material cross, where they do not at a right angle.
    crossed: Option<Crossed>,
}

/// The element instance of the common parameters.
///
/// # Errors
/// When a component is missing or refuses its parameters.
pub fn element(host: &Host, p: &Common) -> Result<(ElementInstance, Vec<ElementField>), StepError> {
    p.crossed()?;
    let mut with = serde_json::Value::Object(p.material.with.clone());
    with["thickness"] = p.thickness().into();
    with["areal_mass"] = p.areal_mass().into();
    let found = host.component(PF_KIND_MATERIAL, &p.material.plugin)?;
    let what = format!("material '{}'", p.material.name);
    // SAFETY: the host gives the table of a material for a material, valid until the process ends (plyflow.h).
    let material = unsafe { MaterialInstance::create(&found, &with.to_string(), &what) }
        .map_err(|e| e.to_string())?;
    let found = host.component(PF_KIND_ELEMENT, &p.element.plugin)?;
    // SAFETY: a text of the host's, valid until `run` returns.
    let manifest = unsafe { found.manifest.as_str() }
        .unwrap_or("{}")
        .to_owned();
    let parameters = if p.element.with.is_null() {
        "{}".into()
    } else {
        p.element.with.to_string()
    };
    let what = format!("element '{}'", p.element.plugin);
    // SAFETY: as above, of an element.
    let element = unsafe { ElementInstance::create(&found, &parameters, material, &what) }
        .map_err(|e| e.to_string())?;
    Ok((element, element_fields(&manifest)))
}

impl Specimen {
    /// Keeps all nodes in the plane in which they are (z).
    pub fn keep_flat(&mut self) {
        let in_plane = Fixed {
            translations: [false, false, true],
            ..Fixed::default()
        };
        for node in 0..self.mesh.points.len() as u32 {
            self.model.fix(node, in_plane);
        }
    }

    /// Builds the model of one sheet. `axis` is the direction of material axis e1 in the undeformed plane;
    /// e2 lies 90 degrees counter-clockwise from it (seen against the normal).
    ///
    /// # Errors
    /// When a component refuses or the mesh makes no model.
    pub fn new(
        host: &Host,
        p: &Common,
        mesh: QuadMesh,
        axis: Vec3,
        pressed: Pressed,
    ) -> Result<Self, StepError> {
        let sheet = Stacked {
            name: "specimen",
            mesh,
            axis,
            pressed,
        };
        Self::of_sheets(host, p, &[sheet])
    }

    /// Builds the model of several sheets of the same material and element. Its mesh is that of all, one after the other.
    ///
    /// # Errors
    /// When a component refuses or the meshes make no model.
    pub fn of_sheets(host: &Host, p: &Common, sheets: &[Stacked]) -> Result<Self, StepError> {
        let crossed = p.crossed()?;
        let mut mesh = QuadMesh::default();
        let mut specs = Vec::new();
        let mut fields = Vec::new();
        for sheet in sheets {
            let (element, of_element) = element(host, p)?;
            fields = of_element;
            let (first, n) = (mesh.points.len() as u32, sheet.mesh.points.len() as u32);
            let m = sheet.mesh.cells.len();
            specs.push(SheetSpec {
                name: sheet.name.into(),
                nodes: (first..first + n).collect(),
                cells: sheet.mesh.cells.clone(),
                patches: sheet.mesh.patches(),
                axis: sheet.axis,
                steered: None,
                layers: vec![1.0; m],
                pressed: vec![sheet.pressed; m],
                least_areal_mass: vec![0.0; m],
                element,
                elsewhere: None,
                other_material: None,
            });
            mesh.points.extend(&sheet.mesh.points);
            let moved = |c: &[u32; 4]| c.map(|node| node + first);
            mesh.cells.extend(sheet.mesh.cells.iter().map(moved));
        }
        let settings = StepSettings {
            target_step: p.time_step.unwrap_or(0.0),
            safety: p.step_safety,
            damping: p.damping,
        };
        let model = Model::new(mesh.points.clone(), specs, settings).map_err(|e| e.to_string())?;
        Ok(Self {
            model,
            mesh,
            fields,
            crossed,
        })
    }

    /// Values of a field of the element: per cell, or per point for patch fields. Needs a step that kept fields (a frame or a sample).
    pub fn values(&self, field: &ElementField) -> Vec<f64> {
        let own = |name: &str| Some(self.own_values(self.fields.iter().find(|f| f.name == name)?));
        let of_families = self.crossed.and_then(|c| c.field(&field.name, own));
        of_families.unwrap_or_else(|| self.own_values(field))
    }

    /// The same as the element tells it.
    fn own_values(&self, field: &ElementField) -> Vec<f64> {
        let of = |sheet: usize| {
            if field.patch {
                self.model.patch_field(sheet, field.row)
            } else {
                self.model.cell_field(sheet, field.row)
            }
        };
        (0..self.model.sheets().len()).flat_map(of).collect()
    }

    /// The same of a field by name; none when the element does not have it.
    pub fn field(&self, name: &str) -> Option<Vec<f64>> {
        let field = self.fields.iter().find(|f| f.name == name)?;
        Some(self.values(field))
    }
}
