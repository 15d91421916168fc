//! A scene: tool, sheets from the tool upwards, process and friction. What is formed, not how it
//! is computed (element, mesh and step sizes are parameters of the step).
//!
//! Coordinates: x along the tool, y across, z up; the machine bed is the plane z = 0 and the tool
//! stands on it, centred at x = y = 0.

use crate::friction::Friction;
use crate::material::MaterialEntry;
use crate::regions::PlyRegion;
use crate::units::{Angle, Force, Length, Number, Pressure, Time};
use plyflow_fixed::FixedBits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Version of the scene format that this crate reads.
pub const VERSION: u32 = 1;

/// A scene file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Version of the scene format: 1.
    #[schemars(extend("const" = 1))]
    pub plyflow_scene: u32,
    /// Name, used in reports.
    pub name: String,
    /// Free text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// The rigid tool.
    pub tool: Tool,
    /// Sheets in the order of the stack, the one nearest the tool first.
    pub sheets: Vec<Sheet>,
    /// Coulomb coefficients by pair of surfaces.
    pub friction: Friction,
    /// The forming process.
    pub process: Process,
    /// Mirror planes of everything above: explicit forming computes the part with x >= 0 (y >= 0) and writes the whole.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub symmetry: Vec<MirrorPlane>,
}

/// A mirror plane through the tool's axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MirrorPlane {
    /// The plane x = 0.
    X,
    /// The plane y = 0.
    Y,
}

impl MirrorPlane {
    /// The word for it in a scene file.
    pub fn word(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
        }
    }
}

/// The rigid tool: one of the parametric generators or an STL file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Tool {
    /// U-shaped spar with two joggles.
    JoggleSpar(JoggleSpar),
    /// A block with a flat top that lies just above the bed.
    Flat(FlatTool),
    /// U-shaped spar with a recess in its top and sides.
    RampedSpar(RampedSpar),
    /// Half a sphere on the bed.
    Hemisphere(HemisphereTool),
    /// Two domes joined by a waist.
    DoubleDome(DoubleDomeTool),
    /// A tetrahedron with a rounded top and edges.
    Tetrahedron(TetrahedronTool),
    /// A triangulated surface.
    Stl(StlTool),
}

/// The spar of thesis chapter 5: a male tool of trapezoidal section whose height steps twice along its
/// length (two ramps in z), the ramps slanted in plan so that they are asymmetric about the width.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JoggleSpar {
    /// Length along x, measured at the foot on the bed.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Width of the top face between the theoretical corners, before the first joggle.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub top_width: Length,
    /// Height of the top face over the bed before the first joggle.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub height: Length,
    /// Angle of the side and end walls from the vertical.
    #[schemars(extend("x-minimum" = "0 deg", "x-maximum" = "60 deg"))]
    pub draft: Angle,
    /// Radius of the fillets between top and walls, in the section square to the edge where a joggle's ramp is steepest. One radius is
    /// swept along the whole spar: on the ramp the edge climbs and its section is sharper, so in the plane square to x it is larger
    /// by 1 + the square of the ramp's largest slope, everywhere. Where a slanted ramp
    /// runs into this edge both bend the surface: there it is sharper than either, by up to 1 + sin(skew).
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub fillet: Length,
    /// Radius in plan of the vertical edges between side and end walls, at the top. Twice the fillet
    /// unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corner: Option<Length>,
    /// The joggles, in order of `start`.
    pub joggles: Vec<Joggle>,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// One ramp of the top face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joggle {
    /// x (from the tool's centre) where the ramp begins, on the centre line y = 0.
    pub start: Length,
    /// Length of the ramp along x, its fillets included.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Change of height over the ramp, positive upwards with growing x.
    pub rise: Length,
    /// Slant in plan: the ramp begins at x = start + y tan(skew).
    #[schemars(extend("x-minimum" = "-60 deg", "x-maximum" = "60 deg"))]
    pub skew: Angle,
    /// How far the ramp also steps each side wall outwards (y < 0 side, y > 0 side), positive outwards.
    pub side_step: [Length; 2],
    /// Radius of the fillets where the ramp begins and ends, in the section square to it; on an edge that also
    /// steps sideways, of the step and rise together.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub fillet: Length,
}

/// A spar of trapezoidal section whose top and side walls fall back over a ramp, stay back, and return over a ramp of
/// the same length: the kind of tool of thesis chapter 6. With a ramp of 180 mm a depth of 10 mm is its ratio of 1:18 for
/// the top, and a side depth of 5 mm its 1:36 for the sides; the other sizes are not in the thesis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RampedSpar {
    /// Length along x, measured at the foot on the bed.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Width of the top face between the theoretical corners, outside of the recess.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub top_width: Length,
    /// Height of the top face over the bed outside of the recess.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub height: Length,
    /// Angle of the side and end walls from the vertical.
    #[schemars(extend("x-minimum" = "0 deg", "x-maximum" = "60 deg"))]
    pub draft: Angle,
    /// Radius of the fillets between top and walls, and where the ramps begin and end.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub fillet: Length,
    /// Length of the recess's bottom along x, in the middle of the spar.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub recess: Length,
    /// Length of each ramp along x, its fillets included.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub ramp: Length,
    /// How far the top falls back.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub depth: Length,
    /// How far each side wall falls back.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub side_depth: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// A pyramid over an equilateral triangle, one edge of which is parallel to x at y < 0, with its axis on z. Its three
/// edges and its top are rounded; on the bed it ends sharply.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TetrahedronTool {
    /// Edge of the triangle on the bed, between the theoretical corners.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub edge: Length,
    /// Height of the theoretical top over the bed, before rounding; edge * sqrt(2/3) for a regular tetrahedron.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub height: Length,
    /// Radius of the edges and of the top.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub radius: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// A flat block.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlatTool {
    /// Length along x.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Width along y.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub width: Length,
    /// Height of the flat top above the bed.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub height: Length,
    /// Radius of the rounding between top and bed; at most the height.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub fillet: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// Half a sphere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HemisphereTool {
    /// Radius.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub radius: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// Two domes along x, joined by a waist: the kind of tool of the double-dome forming benchmark of woven composites. An outline of two
/// circles and the two arcs between them, hollow and tangent to both, is turned about the x axis; its upper half stands on a
/// vertical wall with the same outline. For example `dome_radius: 60 mm`, `dome_distance: 180 mm`, `waist_radius: 150 mm`: 300 mm
/// long, 120 mm wide and 79.5 mm at the waist. The benchmark's own drawing was not at hand: take its sizes from there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DoubleDomeTool {
    /// Radius of the domes.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub dome_radius: Length,
    /// Distance of their centres.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub dome_distance: Length,
    /// Radius of the hollow arcs between them.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub waist_radius: Length,
    /// Height of the vertical wall under the domes.
    #[serde(default)]
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub wall: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// A tool from an STL file (binary or ASCII).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StlTool {
    /// Path, relative to the scene file.
    pub file: String,
    /// Length of one unit of the file, e.g. `1 mm`.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub unit: Length,
    /// Moves the file's origin, after scaling.
    #[serde(default)]
    pub translate: [Length; 3],
}

/// What a sheet is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SheetKind {
    /// Fabric ply with the given outline.
    Ply,
    /// Film clamped in the frame.
    Diaphragm,
}

/// One sheet of the stack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// Name of its body in artifacts.
    pub name: String,
    /// Ply or diaphragm.
    pub kind: SheetKind,
    /// A material file (path relative to the scene file) or the material itself.
    pub material: MaterialEntry,
    /// Plies: length along x before forming.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Option<Length>,
    /// Plies: width along y before forming.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub width: Option<Length>,
    /// Plies, instead of length and width: the outline before forming, relative to `centre`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-expected" = "a list of points, [[x, y], ..], or {circle: {radius: ..}}"))]
    pub outline: Option<Contour>,
    /// Plies with an outline: holes in it, relative to `centre`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<Contour>,
    /// Plies: position of the centre over the tool; of an outline, of its point (0, 0).
    #[serde(default)]
    pub centre: [Length; 2],
    /// Plies: direction of fibre family 1 from x, counter-clockwise seen from above.
    #[serde(default)]
    pub fibre_1: Angle,
    /// Plies: direction of fibre family 2; the stitch lies between family 1 and 2, so that positive
    /// shear stretches it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fibre_2: Option<Angle>,
    /// Plies: places with another friction, or without stitches.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<PlyRegion>,
}

/// Direction (rad, from x) of the first axis of a ply whose fibre families lie at `fibre_1` and `fibre_2` (rad): that of the family
/// which the other follows counter-clockwise, so that the stitch lies between the first axis and the second. Elements and their
/// membrane forces have these axes, whichever way round the scene names the families.
///
/// ```
/// use plyflow_model::scene::first_axis;
/// let deg = f64::to_radians;
/// assert_eq!(first_axis(deg(-45.0), deg(45.0)), deg(-45.0));
/// assert_eq!(first_axis(deg(45.0), deg(-45.0)), deg(-45.0));
/// ```
pub fn first_axis(fibre_1: f64, fibre_2: f64) -> f64 {
    if (fibre_2 - fibre_1).fixed_sin() >= 0.0 {
        fibre_1
    } else {
        fibre_2
    }
}

/// A closed contour in the plane. It may run either way round and closes by itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "a list of points, [[x, y], ..], or {circle: {radius: ..}}"))]
pub enum Contour {
    /// Corners `[x, y]`, at least three.
    Polygon(Vec<[Length; 2]>),
    /// A circle.
    Round(RoundContour),
}

/// A round contour.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoundContour {
    /// The circle.
    pub circle: Circle,
}

/// A circle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Circle {
    /// Its centre.
    #[serde(default)]
    pub centre: [Length; 2],
    /// Its radius.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub radius: Length,
}

/// The process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Process {
    /// Double-diaphragm forming.
    DoubleDiaphragm(DoubleDiaphragm),
    /// Press forming: punch, die and blank holder.
    Press(Press),
}

impl Process {
    /// Height over the tool's highest point at which the lowest sheet starts (m).
    pub fn clearance(&self) -> f64 {
        match self {
            Self::DoubleDiaphragm(p) => p.clearance.si(),
            Self::Press(_) => 0.0,
        }
    }

    /// The word for it in a scene file.
    pub fn word(&self) -> &'static str {
        match self {
            Self::DoubleDiaphragm(_) => "double_diaphragm",
            Self::Press(_) => "press",
        }
    }
}

/// Press forming: the scene's tool is the punch, drawn where it ends. It starts `stroke` below, in touch with
/// the lowest ply, and rises through the opening of the die, a plate over the plies; a blank holder below them,
/// when given, keeps them from folding. Upside down to most presses; nothing depends on that but the weight,
/// which is left out unless `weight` says where it pulls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Press {
    /// Way of the punch, from its first touch.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub stroke: Length,
    /// Simulated duration of the stroke.
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub forming_time: Time,
    /// Share of that time in which the punch gathers speed, and in which it loses it.
    #[serde(default = "Press::default_ramp_share")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.5))]
    pub ramp_share: Number,
    /// Simulated duration after the stroke, for the motion to die out.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub settling_time: Time,
    /// The die.
    pub die: PressPlate,
    /// The blank holder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holder: Option<Holder>,
    /// Where the weight of the plies pulls them; left out: they have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<Towards>,
}

impl Press {
    fn default_ramp_share() -> Number {
        Number(0.1)
    }
}

/// A direction in a press.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Towards {
    /// Upwards, onto the die.
    Die,
    /// Downwards, onto the holder.
    Holder,
}

/// A flat plate with a round opening about the tool's axis x = y = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressPlate {
    /// Radius of the opening.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub opening_radius: Length,
    /// Radius of the rounding of its edge.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub edge_radius: Length,
}

/// The blank holder: a plate that keeps a distance from the die, or one that a force presses towards it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Holder {
    /// Its opening; that of the die unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub opening_radius: Option<Length>,
    /// Radius of the rounding of its edge; that of the die unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub edge_radius: Option<Length>,
    /// How it is held.
    pub hold: Hold,
}

/// What a blank holder keeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// Distance between the faces of die and holder.
    Gap(#[schemars(extend("x-exclusive-minimum" = "0 mm"))] Length),
    /// Force towards the die.
    Force(#[schemars(extend("x-minimum" = "0 N"))] Force),
}

/// Double-diaphragm forming: the frame is lowered with the bag under vacuum until the lower film meets
/// the bed, then the air under it is drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DoubleDiaphragm {
    /// Length of the frame's opening along x.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub frame_length: Length,
    /// Width of the frame's opening along y.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub frame_width: Length,
    /// Height of the lower film over the tool's highest point at the start.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub clearance: Length,
    /// Vacuum in the bag: pressure of the surroundings over that between the films. A single value comes in the second half of
    /// bagging; a table tells its course over all of bagging.
    #[schemars(extend("x-minimum" = "0 Pa"))]
    pub bag_pressure: PressureCourse,
    /// Pressure drawn under the lower film. A single value is that at the end, reached smoothly; a table tells its course over drawing.
    #[schemars(extend("x-minimum" = "0 Pa"))]
    pub forming_pressure: PressureCourse,
    /// Simulated duration of evacuating the bag.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub bagging_time: Time,
    /// Simulated duration of lowering the frame.
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub lowering_time: Time,
    /// Simulated duration of drawing the air.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub drawing_time: Time,
    /// Simulated duration at full pressure, for the motion to die out.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub settling_time: Time,
    /// Strain by which the frame stretches the films before the bag is evacuated. Slack films have nothing to
    /// carry the in-plane compression of a stack under vacuum.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "maximum" = 0.2))]
    pub film_pre_stretch: Number,
    /// Distance around the plies beyond which the two films are taken as joined (they stick under the bag
    /// pressure; their seal lies at the frame).
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub film_joint_margin: Length,
    /// Where the weight of plies and films pulls them; left out: they have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<WeightDirection>,
}

/// A pressure that comes in one phase of the process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "a pressure such as `1 bar`, or {table: [{share: 0, pressure: 0 kPa}, .., {share: 1, pressure: ..}]}"))]
pub enum PressureCourse {
    /// What it is at the end of the phase; it grows smoothly.
    Value(Pressure),
    /// Its course over the phase.
    Course(PressureTable),
}

impl PressureCourse {
    /// What it is at the end of the phase (Pa); 0 for a table without rows.
    pub fn last(&self) -> f64 {
        match self {
            Self::Value(p) => p.si(),
            Self::Course(c) => c.table.last().map_or(0.0, |row| row.pressure.si()),
        }
    }
}

/// The course of a pressure over a phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureTable {
    /// Two or more rows, from share 0 with no pressure to share 1. Between them a monotone cubic without kinks.
    pub table: Vec<PressureAt>,
}

/// A row of the course of a pressure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureAt {
    /// Share of the phase that is over: growing from 0 to 1.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub share: Number,
    /// Pressure then.
    #[schemars(extend("x-minimum" = "0 Pa"))]
    pub pressure: Pressure,
}

/// A direction in double-diaphragm forming.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WeightDirection {
    /// Downwards, onto the tool and the bed.
    Tool,
    /// Upwards, away from them: a machine whose tool hangs over the films.
    Away,
}
