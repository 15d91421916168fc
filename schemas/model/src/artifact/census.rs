//! The kinds `census`, the wrinkles of a formed ply, and `census-comparison`, those of several runs side by side.

use crate::artifact::attributes::Attributes;
use crate::artifact::shown::{Map, Plot, Table};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Attributes of the kind `census`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Census {
    /// Name of the ply, that of its body too.
    pub ply: String,
    /// The circles, in the order of the step's parameter.
    pub circles: Vec<CensusCircle>,
    /// Least height of a wrinkle over its base (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threshold: Option<f64>,
    /// Least prominence of a wrinkle (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prominence: Option<f64>,
    /// The sections beside the axis, in the order of the step's parameter.
    #[serde(default)]
    pub cross_sections: Vec<CrossSection>,
    /// Which arrays are the curve of a label in a plot.
    pub curves: Vec<CensusCurve>,
    /// Plots of the circles, of the sections and of the distributions.
    #[serde(default)]
    pub plots: Vec<Plot>,
    /// Maps of the fields of the ply.
    #[serde(default)]
    pub maps: Vec<Map>,
}

impl Attributes for Census {
    const KIND: &'static str = "census";
}

/// A circle about the axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CensusCircle {
    /// (m).
    pub radius: f64,
    /// What was counted, in the order of the angles. Lengths are those of the first circle; on the others they are 0.
    pub wrinkles: Vec<Wrinkle>,
}

/// A wrinkle where a circle crosses it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Wrinkle {
    /// Angle from x of the middle of the arc that is its width, 0 to 2 pi (rad): a top that lies flat on a plate has no place.
    pub angle: f64,
    /// z of its top (m).
    pub z: f64,
    /// Its top over the circle's base (m); negative: under it.
    pub height: f64,
    /// How far its top stands over the higher of the two saddles that part it from higher tops (m); for the
    /// highest top of a circle over the circle's lowest place.
    pub prominence: f64,
    /// Length of the arc about its top on which it is at least half as high (m), no farther than the lowest places
    /// between it and its neighbours.
    pub width: f64,
    /// Mean shear angle over that arc (rad).
    pub shear: f64,
    /// Length of the line of its tops over neighbouring circles (m); 0 unless traced.
    pub length: f64,
}

impl Wrinkle {
    /// 0 to 3: in which quarter of the circle it is, counted from x > 0, y > 0 counter-clockwise.
    pub fn quadrant(&self) -> usize {
        (self.angle / FRAC_PI_2) as usize % 4
    }
}

/// A section beside the axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CrossSection {
    /// Its label in plots, by which it is found among the curves.
    pub label: String,
    /// What stands for it in the names of results.
    pub result: String,
    /// What was counted along it.
    #[serde(default)]
    pub wrinkles: Vec<SectionWrinkle>,
}

/// A wrinkle where a section crosses it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SectionWrinkle {
    /// Where it is along the section, from the place nearest to the axis (m).
    pub place: f64,
    /// z of its top (m).
    pub z: f64,
    /// Its top over the section's base (m); negative: under it.
    pub height: f64,
    /// As [`Wrinkle::prominence`] (m).
    pub prominence: f64,
    /// Length about its top on which it is at least half as high (m), as [`Wrinkle::width`].
    pub width: f64,
    /// Mean shear angle over that (rad).
    pub shear: f64,
}

/// Which arrays are a curve.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CensusCurve {
    /// Name of the plot that shows it: `circles`, `sections`, `cross_sections`, `deviation_density`, `bending_moment_density`.
    pub plot: String,
    /// Its label there.
    pub label: String,
    /// Path of an array below `/data`.
    pub x: String,
    /// Path of an array below `/data` with as many values.
    pub y: String,
}

impl CensusCurve {
    /// Whether another one, of the same or of another census, shows the same: it has the same label in the same plot.
    pub fn is(&self, other: &Self) -> bool {
        (&self.plot, &self.label) == (&other.plot, &other.label)
    }
}

/// Attributes of the body of a ply of which wrinkles were counted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CensusBody {
    /// Name of the ply.
    pub ply: String,
}

/// Attributes of the kind `census-comparison`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CensusComparison {
    /// The runs, in the order of the table.
    pub runs: Vec<CensusRun>,
    /// The table of the runs.
    #[serde(default)]
    pub tables: Vec<Table>,
    /// Curves of all runs over each other.
    #[serde(default)]
    pub plots: Vec<Plot>,
    /// Their plies side by side.
    #[serde(default)]
    pub maps: Vec<Map>,
}

impl Attributes for CensusComparison {
    const KIND: &'static str = "census-comparison";
}

/// A run whose census is compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CensusRun {
    /// Its name in paths and the name of its body: that of its census step, with its place in a fan-out.
    pub name: String,
    /// For people.
    pub label: String,
    /// Constant bending stiffness (N m), or `null` where none was told.
    pub bending_stiffness: Option<f64>,
}

/// Attributes of the body of a ply in a comparison of censuses.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CensusRunBody {
    /// What its run is called.
    pub label: String,
}
