//! A scene: tool, sheets from the tool upwards, process and friction. What is formed, not how it
//! is computed (element, mesh and step sizes are parameters of the step).
//!
//! Coordinates: x along the tool, y across, z up; the machine bed is the plane z = 0 and the tool
//! stands on it, centred at x = y = 0.

use crate::friction::Friction;
use crate::material::MaterialEntry;
use crate::outline::{ContourName, OutlineError, Point, Region};
use crate::regions::PlyRegion;
use crate::units::{Angle, Length};
use plyflow_fixed::FixedBits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::book::PlyBook;
pub use crate::contour::{Circle, Contour, Drawing, NamedContour};
pub use crate::process::{
    DoubleDiaphragm, Hold, Holder, Press, PressPlate, PressureAt, PressureCourse, PressureTable,
    Process, SingleDiaphragm, Towards, WeightDirection,
};
pub use crate::stamping::{
    ForceCourse, Gripper, MatchingDie, PartMotion, Pressed, Side, Stamping, StampingPart, Vertical,
};
pub use crate::steering::{
    FibreDirection, Laid, SteeredPoint, Steering, SteeringError, SteeringTable, first_axis,
};
pub use crate::tool::{
    DoubleDomeTool, FlatTool, GivenSurface, HemisphereTool, InputTool, Joggle, JoggleSpar,
    RampedSpar, StlTool, TetrahedronTool, Tool,
};

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
    /// Sheets in the order of the stack, the one nearest the tool first. The plies of a ply book may stand among them.
    #[schemars(with = "Vec<SheetEntry>")]
    pub sheets: Vec<Sheet>,
    /// Coulomb coefficients by pair of surfaces.
    pub friction: Friction,
    /// The forming process.
    pub process: Process,
    /// Mirror planes of everything above: explicit forming computes the part with x >= 0 (y >= 0) and writes the whole.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub symmetry: Vec<MirrorPlane>,
}

impl Scene {
    /// Of JSON. Reading a scene takes seconds to compile, and whoever reads one by this needs not compile it again.
    ///
    /// # Errors
    /// What does not fit, and what was expected.
    #[inline(never)]
    pub fn from_json(value: serde_json::Value) -> Result<Self, serde_json::Error> {
        serde_json::from_value(value)
    }

    /// The same for a field of what is read from something else (`deserialize_with`).
    ///
    /// # Errors
    /// As [`Scene::from_json`].
    pub fn of_json<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(from)?;
        Self::from_json(value).map_err(serde::de::Error::custom)
    }
}

/// What may stand in a scene's list of sheets.
// A `Scene` has only sheets: who resolves a scene puts the plies of a book in the place of the words that ask for them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum SheetEntry {
    /// One sheet.
    Sheet(Box<Sheet>),
    /// The plies of a ply book, in its order.
    Book(Box<BookEntry>),
}

/// The plies of a ply book.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BookEntry {
    /// The book, and what its rows leave open.
    pub plies: PlyBook,
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
    /// Plies, instead of length and width: the outline before forming, relative to `centre`. One of another step brings its holes along.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-expected" = "a list of points, [[x, y], ..], {circle: {radius: ..}}, {drawing: {file: ..}}, or {input: NAME} from another step"))]
    pub outline: Option<Contour>,
    /// Plies with an outline: holes in it, relative to `centre`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<Contour>,
    /// Plies: position of the centre over the tool; of an outline, of its point (0, 0).
    #[serde(default)]
    pub centre: [Length; 2],
    /// Plies: direction of fibre family 1 from x, counter-clockwise seen from above; of steered fibres a table of directions by place.
    #[serde(default)]
    pub fibre_1: FibreDirection,
    /// Plies: direction of fibre family 2; the stitch lies between family 1 and 2, so that positive
    /// shear stretches it. Left out with steered fibres: there it lies 90 deg from family 1 at each place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fibre_2: Option<Angle>,
    /// Plies: places with another friction, or without stitches.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<PlyRegion>,
    /// Plies on another ply: tied to it, as by stitches through both; what lies on it as laid neither slides on it nor comes off it.
    #[serde(default, skip_serializing_if = "is_off")]
    pub tied: bool,
}

/// Whether a word that is left out by default has its default.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_off(given: &bool) -> bool {
    !*given
}

impl Sheet {
    /// The names of the sheets that are tied, each with that of the ply below it, to which it is.
    pub fn ties(sheets: &[Self]) -> impl Iterator<Item = (&str, &str)> {
        let tied = sheets.windows(2).filter(|two| two[1].tied);
        tied.map(|two| (two[1].name.as_str(), two[0].name.as_str()))
    }

    /// The region of a sheet with an `outline`, over the tool; `None` for a sheet without one.
    ///
    /// # Errors
    /// When outline and holes bound no region, stand beside `length` and `width`, or are made by another step or drawn in a file and have not been read.
    pub fn region(&self) -> Result<Option<Region>, OutlineError> {
        let Some(outline) = &self.outline else {
            return match self.holes.is_empty() {
                true => Ok(None),
                false => Err(OutlineError::HolesAlone),
            };
        };
        if self.length.is_some() || self.width.is_some() {
            return Err(OutlineError::TwoSizes);
        }
        if let Some(error) = self.not_read(outline) {
            return Err(error);
        }
        let centre = self.centre.map(|c| c.si());
        let placed = |contour: &Contour| -> Vec<Point> {
            let corners = contour.corners().into_iter();
            corners
                .map(|p| [p[0] + centre[0], p[1] + centre[1]])
                .collect()
        };
        Region::new(placed(outline), self.holes.iter().map(placed).collect()).map(Some)
    }

    /// The first of its contours that another step makes, or that is drawn in a file, and that has not been read.
    fn not_read(&self, outline: &Contour) -> Option<OutlineError> {
        let holes = self.holes.iter().enumerate();
        let all = holes.map(|(i, hole)| (ContourName::Hole(i), hole));
        let mut all = std::iter::once((ContourName::Outline, outline)).chain(all);
        all.find_map(|(contour, c)| {
            let why = c.unread()?;
            Some(OutlineError::NotRead { contour, why })
        })
    }

    /// The rectangle of a sheet with `length` and `width` over the tool: x0, y0, x1, y1 (m).
    pub fn rectangle(&self) -> Option<[f64; 4]> {
        let [cx, cy] = self.centre.map(|c| c.si());
        let (hl, hw) = (0.5 * self.length?.si(), 0.5 * self.width?.si());
        Some([cx - hl, cy - hw, cx + hl, cy + hw])
    }

    /// What the sheet covers before forming, over the tool; `None` where it has no size.
    ///
    /// # Errors
    /// As [`Sheet::region`].
    pub fn footprint(&self) -> Result<Option<Region>, OutlineError> {
        let region = self.region()?;
        Ok(region.or_else(|| self.rectangle().map(Region::rectangle)))
    }

    /// Directions of the fibre families (rad): the second a quarter turn on where it is not stated. `None` of a ply whose fibres are steered.
    pub fn fibres(&self) -> Option<[f64; 2]> {
        let FibreDirection::Straight(first) = &self.fibre_1 else {
            return None;
        };
        let first = first.si();
        let square = || first + std::f64::consts::FRAC_PI_2;
        Some([first, self.fibre_2.map_or_else(square, |a| a.si())])
    }

    /// Directions of the fibre families by place.
    ///
    /// # Errors
    /// When its points tell none, or have not been read.
    pub fn laid(&self) -> Result<Laid, SteeringError> {
        match &self.fibre_1 {
            FibreDirection::Straight(_) => {
                let fibres = self.fibres().unwrap_or_default();
                Ok(Laid::Straight(fibres))
            }
            FibreDirection::Steered(steering) => {
                Laid::steered(steering.points(self.centre.map(|c| c.si()))?)
            }
        }
    }

    /// What mirror planes do to its fibre families, the same for both planes; `None` where its fibres lie askew to them, are steered, or do not cross
    /// at a right angle.
    pub fn families(&self) -> Option<Families> {
        let [first, second] = self.fibres()?;
        if Laid::Straight([first, second]).crossing().is_some() {
            return None;
        }
        let axis = first_axis(first, second);
        let (x, y) = (axis.fixed_cos().abs(), axis.fixed_sin().abs());
        if x.min(y) < FIBRES_APART {
            Some(Families::Kept)
        } else if (x - y).abs() < FIBRES_APART {
            Some(Families::Exchanged)
        } else {
            None
        }
    }
}

/// How far fibres may be from the directions that mirror planes allow (rad).
const FIBRES_APART: f64 = 1e-6;

/// What a mirror plane does to the fibre families of a sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Families {
    /// Each is its own mirror image; shear changes its sign.
    Kept,
    /// They are each other's; shear keeps its sign.
    Exchanged,
}
