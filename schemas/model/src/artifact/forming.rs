//! The kind `forming`: a formed stack of sheets.

use crate::artifact::attributes::Attributes;
use crate::artifact::shear_limits::ShearLimits;
use crate::artifact::zones::Zone;
use crate::outline::{Millimetres, Point};
use crate::regions::Stitches;
use crate::scene::{MirrorPlane, SheetKind};
use crate::steering::Laid;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Attributes of the kind `forming`. A kinematic drape has neither mass nor contact: it leaves out what comes from these.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Forming {
    /// Name of the scene.
    #[serde(default)]
    pub scene: Option<String>,
    /// The sheets in the order of the stack, from the tool upwards.
    pub sheets: Vec<Sheet>,
    /// Whether sheets touch what really lies under them: where plies below end, a ply lies lower than its `offset` by their thickness. Left out: no.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub contact_by_place: bool,
    /// Whether there is no machine bed under tool and plies, as in a press, in a stamping, and under a single film where the scene says so: what hangs
    /// beside the tool has nothing there to lie on, and its distance from the tool is not judged. Left out: no.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub without_bed: bool,
    /// The mirror planes beside which a part was computed. Meshes, fields and energies are the whole's all the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub symmetry: Option<Vec<MirrorPlane>>,
    /// Of the plies (m).
    #[serde(default)]
    pub element_size: f64,
    /// Distance of the threads of a kinematic net (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub net_spacing: Option<f64>,
    /// The zone of a local run; `null` for the whole.
    #[serde(default)]
    pub zone: Option<Zone>,
    /// Of a zone whose process goes on more slowly than the scene says: how many times; left out: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slower: Option<f64>,
    /// The smallest that was used (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_step: Option<f64>,
    /// Number of steps in time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cycles: Option<u64>,
    /// Number of cells times number of steps in time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub element_cycles: Option<f64>,
    /// Number of cells of all sheets.
    #[serde(default)]
    pub elements: u64,
    /// How far to trust the run by its energies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy: Option<Energy>,
    /// By pair: how far bodies reach into each other, as contact has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub penetration: Option<BTreeMap<String, Penetration>>,
    /// Share of the thinner body up to which overlaps are not told, at the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overlap_bound: Option<f64>,
    /// The same on the way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overlap_peak_bound: Option<f64>,
    /// By rigid part (`tool`, `die`, `holder`): by how much what contacts see of it differs from its cells. Of `forming-kinematic`: how far the
    /// smooth surface under the net lies off the tool's facets.
    #[serde(default)]
    pub tool_field_error: BTreeMap<String, FieldError>,
    /// By pair that the watch saw in each other at any row; by row also `/data/history/depth/PAIR`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<BTreeMap<String, Depth>>,
    /// Share of the thinner sheet up to which depths are not told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_bound: Option<f64>,
    /// Of a tool whose scene has put it in its place by more than `translate`: how.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_placement: Option<ToolPlacement>,
    /// What the user should know.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// Where a tool's file, or a body of another step, lies in the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ToolPlacement {
    /// By rows: takes (x, y, z, 1) of the file (m) to the scene (m). It turns and moves, and its inverse brings results back.
    pub matrix: [[f64; 4]; 4],
    /// Length of one unit of the file (m).
    pub unit: f64,
}

impl Attributes for Forming {
    const KIND: &'static str = "forming";
}

impl Forming {
    /// The plies in the order of the stack.
    pub fn plies(&self) -> impl Iterator<Item = &Sheet> {
        self.sheets.iter().filter(|s| s.is_ply())
    }
}

/// A sheet of a formed stack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sheet {
    /// Its name, that of its body too.
    pub name: String,
    /// What it is.
    pub kind: SheetKind,
    /// Name of its material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// (m).
    pub thickness: f64,
    /// Distance of its mid-surface from the tool where all sheets lie on it (m).
    pub offset: f64,
    /// Mass of its material per undeformed area (kg/m2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub areal_mass: Option<f64>,
    /// Of a ply whose material says so: the shear angles from which its fabric wrinkles (rad). Left out: its shear is not judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_shear: Option<ShearLimits>,
    /// Mass that was added to it for a larger step in time (kg).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub added_mass: Option<f64>,
    /// Plugin of its elements; `null` for a kinematic net.
    #[serde(default)]
    pub element: Option<String>,
    /// Of a ply with two: the plugin of its other elements.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub element_elsewhere: Option<String>,
    /// Of a ply with two: how many elements are those of `element`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bending_elements: Option<usize>,
    /// Direction of a ply's first fibres in the flat ply, from x (rad).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fibre_1: Option<f64>,
    /// Direction of a ply's second fibres (rad).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fibre_2: Option<f64>,
    /// Of a ply whose fibres are steered, instead of `fibre_1` and `fibre_2`: `[[x, y, angle], ..]` (m, m, rad), points of the flat ply with the direction of
    /// its first fibres. Between them cosine and sine of the doubled angle are linear in triangles; the second fibres lie a quarter turn on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steering: Option<Vec<[f64; 3]>>,
    /// `[[x, y], ..]` (m), of the whole flat ply, whatever part of it the run has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outline: Option<Vec<Point>>,
    /// `[[[x, y], ..], ..]` (m), its holes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<Vec<Point>>,
    /// Where it rubs otherwise, or has no stitches.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<RegionFacts>,
    /// The ply below it that it is tied to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tied_to: Option<String>,
    /// Of a mesh that was fitted to an outline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh_quality: Option<MeshQuality>,
    /// `[x, y]` (m), where a kinematic net starts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Point>,
    /// Nodes of a kinematic net.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub net_nodes: Option<usize>,
    /// What a step of somebody else tells besides.
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

impl Sheet {
    /// A sheet of which nothing else is told.
    pub fn new(name: impl Into<String>, kind: SheetKind, thickness: f64, offset: f64) -> Self {
        Self {
            name: name.into(),
            kind,
            material: None,
            thickness,
            offset,
            areal_mass: None,
            over_shear: None,
            added_mass: None,
            element: None,
            element_elsewhere: None,
            bending_elements: None,
            fibre_1: None,
            fibre_2: None,
            steering: None,
            outline: None,
            holes: Vec::new(),
            regions: Vec::new(),
            tied_to: None,
            mesh_quality: None,
            start: None,
            net_nodes: None,
            other: Map::new(),
        }
    }

    /// Whether it is a ply of the preform, not a film.
    pub fn is_ply(&self) -> bool {
        self.kind == SheetKind::Ply
    }

    /// Tells its fibres.
    #[must_use]
    pub fn with_fibres(mut self, laid: &Laid) -> Self {
        match laid {
            Laid::Straight([first, second]) => {
                (self.fibre_1, self.fibre_2) = (Some(*first), Some(*second));
            }
            Laid::Steered(field) => self.steering = Some(field.points().to_vec()),
        }
        self
    }

    /// Directions of both fibre families in the flat ply; `None` where they are not told, or its points tell none.
    pub fn laid(&self) -> Option<Laid> {
        match &self.steering {
            Some(points) => Laid::steered(points.clone()).ok(),
            None => Some(Laid::Straight([self.fibre_1?, self.fibre_2?])),
        }
    }
}

/// A region of a ply, as [`crate::regions::PlyRegion`] asks for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RegionFacts {
    /// Its name.
    pub name: String,
    /// `[[x, y], ..]` (m) over the tool.
    pub outline: Vec<Point>,
    /// (m2).
    pub area: f64,
    /// Names of the partners against which it rubs otherwise.
    pub friction: Vec<String>,
    /// `removed`, or `null` where they are as elsewhere.
    pub stitches: Option<Stitches>,
}

/// How good a mesh is that was fitted to an outline.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeshQuality {
    /// The smallest scaled Jacobian of all elements (1).
    pub least_scaled_jacobian: f64,
    /// The smallest angle (rad).
    pub least_angle: f64,
    /// The largest angle (rad).
    pub largest_angle: f64,
    /// The largest ratio of an element's longest edge to its shortest (1).
    pub edge_ratio: f64,
    /// The shortest edge over the element size (1).
    pub least_edge: f64,
    /// Difference of the mesh's area from the outline's, over that (1).
    pub area_error: f64,
    /// `[x, y]` (m), where the element with the smallest scaled Jacobian lies.
    pub worst_at: Point,
}

/// Below this scaled Jacobian a mesh is called poor.
pub const POOR_JACOBIAN: f64 = 0.3;

impl MeshQuality {
    /// What a user should know of a poor mesh.
    pub fn warning(&self) -> Option<String> {
        (self.least_scaled_jacobian < POOR_JACOBIAN).then(|| {
            format!(
                "its mesh is poor: least scaled Jacobian {:.2} (warning below {POOR_JACOBIAN}), angles from {:.0} to {:.0} deg, worst at \
                 {}; round off narrow corners of the outline or take smaller elements",
                self.least_scaled_jacobian,
                self.least_angle.to_degrees(),
                self.largest_angle.to_degrees(),
                Millimetres(self.worst_at)
            )
        })
    }
}

/// How far to trust a run by its energies.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Energy {
    /// Largest work that is unaccounted for, over all work done (1).
    pub peak_drift_ratio: Option<f64>,
    /// Largest kinetic energy over internal energy (1).
    pub peak_kinetic_ratio: Option<f64>,
    /// Whether that stays below the step's `kinetic_bound`.
    pub kinetic_bound_kept: Option<bool>,
    /// Energy of hourglass control over internal energy at the end (1).
    pub hourglass_ratio: Option<f64>,
}

/// How far two bodies reach into each other at the end, as contact has it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Penetration {
    /// Largest (m).
    pub max: f64,
    /// 99.9 % quantile over the nodes in touch (m).
    pub q999: f64,
    /// The latter as a share of the thinner body; `null` where that is not known.
    #[serde(default)]
    pub overlap: Option<f64>,
    /// `[x, y, z]` (m) of the deepest node, or `null`.
    #[serde(default)]
    pub place: Option<[f64; 3]>,
    /// Over all frames.
    #[serde(default)]
    pub peak: Option<PenetrationPeak>,
}

/// How far two bodies reached into each other on the way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PenetrationPeak {
    /// Largest (m).
    pub max: f64,
    /// When that was (s).
    pub max_time: f64,
    /// `[x, y, z]` (m), where that was, or `null`.
    #[serde(default)]
    pub place: Option<[f64; 3]>,
    /// Largest 99.9 % quantile (m), of the frames with 100 nodes in touch and more, where there are such.
    pub q999: f64,
    /// When that was (s).
    #[serde(default)]
    pub q999_time: f64,
    /// `[x, y, z]` (m) of the deepest node then, or `null`.
    #[serde(default)]
    pub q999_place: Option<[f64; 3]>,
    /// That quantile as a share of the thinner body; `null` where that is not known.
    #[serde(default)]
    pub overlap: Option<f64>,
}

/// By how much what contacts see of a rigid part differs from its cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FieldError {
    /// Largest (m).
    pub max: f64,
    /// `[x, y, z]` (m), where that is.
    pub place: [f64; 3],
}

/// How deep two bodies are in each other at the end, as the watch has it, which knows nothing of contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Depth {
    /// (m).
    pub end: f64,
    /// Share of the thinner sheet (1).
    pub share: f64,
    /// `[x, y, z]` (m), or `null` where they are not in each other.
    pub place: Option<[f64; 3]>,
    /// Depth beyond which `end` is told (m), or `null` where none is.
    pub bound: Option<f64>,
    /// The deepest of all rows.
    pub peak: DepthPeak,
}

/// How deep two bodies were in each other on the way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DepthPeak {
    /// (m).
    pub depth: f64,
    /// Share of the thinner sheet (1).
    pub share: f64,
    /// (s).
    pub time: f64,
    /// `[x, y, z]` (m), or `null`.
    pub place: Option<[f64; 3]>,
}

/// Attributes of the body of a sheet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SheetBody {
    /// What it is.
    pub kind: SheetKind,
    /// (m).
    pub thickness: f64,
    /// As [`Sheet::offset`] (m).
    pub offset: f64,
}

/// Attributes of a body that does not deform: tool, die, punch, holder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RigidBody {
    /// Always true.
    pub rigid: bool,
}

impl RigidBody {
    /// The attributes of every rigid body.
    pub const ATTRIBUTES: Self = Self { rigid: true };
}

/// Attributes of a body of which nothing is told.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlainBody {}
