//! The limits of the engineer: how large defects may be for the part to be good.

use crate::outline::Point;
use crate::regions::{PlyRegion, RegionError, RegionRectangle};
use crate::units::{Angle, Area, Length};
use crate::{contour::Contour, outline};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How large defects may be for the part to be good. They are held against what steps have found, and change nothing of what steps compute.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Of the whole part.
    #[serde(flatten)]
    pub part: LimitValues,
    /// Places with limits of their own. At a place these count instead of those of the part; of several places the last one that states a limit.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<LimitPlace>,
    /// Where the limits come from, such as a drawing or a specification.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

/// A place with limits of its own: a ply, a region of plies, or both.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LimitPlace {
    /// How it is called; left out: by what it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Name of a ply; left out: every ply.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ply: Option<String>,
    /// Name of a region of plies in the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// A polygon or circle on the flat ply instead, in the axes of the flat maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-expected" = "a list of points, [[x, y], ..], or {circle: {radius: ..}}"))]
    pub polygon: Option<Contour>,
    /// A rectangle on the flat ply instead, in the axes of the flat maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rectangle: Option<RegionRectangle>,
    /// What holds there.
    #[serde(flatten)]
    pub values: LimitValues,
}

/// Limits, each for one quantity. What is exactly as large as its limit is within it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LimitValues {
    /// Largest height of a wrinkle: how far its top stands off the tool.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub wrinkle_height: Option<Length>,
    /// Largest length of a wrinkle along its crest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub wrinkle_length: Option<Length>,
    /// Largest gap between the tool and a ply that bridges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub bridging_gap: Option<Length>,
    /// Largest area of the flat ply over which it bridges at one place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 mm2"))]
    pub bridging_area: Option<Area>,
    /// Largest shear angle, of either sign.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 deg"))]
    pub shear: Option<Angle>,
    /// Largest positive shear angle, for a fabric that bears less of the one sign.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 deg"))]
    pub shear_positive: Option<Angle>,
    /// Least negative shear angle, such as `-50 deg`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-maximum" = "0 deg"))]
    pub shear_negative: Option<Angle>,
    /// Largest strain of fibres, of either sign, such as `0.01`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub fibre_strain: Option<f64>,
    /// Largest angle between the fibres of the formed ply and the direction in which they were laid, of either family and sign. On the formed ply
    /// that direction counts as on the flat one: from the x axis, which is projected onto the ply.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 deg"))]
    pub fibre_deviation: Option<Angle>,
}

/// What a limit is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LimitOn {
    /// How far the top of a wrinkle stands off the tool (m).
    WrinkleHeight,
    /// Length of a wrinkle along its crest (m).
    WrinkleLength,
    /// Between the tool and a ply that bridges (m).
    BridgingGap,
    /// Of the flat ply where it bridges (m2).
    BridgingArea,
    /// Shear angle of either sign (rad).
    Shear,
    /// Positive shear angle (rad).
    ShearPositive,
    /// Negative shear angle (rad).
    ShearNegative,
    /// Strain of fibres of either sign (1).
    FibreStrain,
    /// Angle of formed fibres to the direction as laid, of either family and sign (rad).
    FibreDeviation,
}

impl LimitOn {
    /// All, in the order in which they are told.
    pub const ALL: [Self; 9] = [
        Self::WrinkleHeight,
        Self::WrinkleLength,
        Self::BridgingGap,
        Self::BridgingArea,
        Self::Shear,
        Self::ShearPositive,
        Self::ShearNegative,
        Self::FibreStrain,
        Self::FibreDeviation,
    ];

    /// Its key in a workflow.
    pub const fn name(self) -> &'static str {
        match self {
            Self::WrinkleHeight => "wrinkle_height",
            Self::WrinkleLength => "wrinkle_length",
            Self::BridgingGap => "bridging_gap",
            Self::BridgingArea => "bridging_area",
            Self::Shear => "shear",
            Self::ShearPositive => "shear_positive",
            Self::ShearNegative => "shear_negative",
            Self::FibreStrain => "fibre_strain",
            Self::FibreDeviation => "fibre_deviation",
        }
    }

    /// For people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::WrinkleHeight => "wrinkle height",
            Self::WrinkleLength => "wrinkle length",
            Self::BridgingGap => "bridging gap",
            Self::BridgingArea => "bridging area",
            Self::Shear => "shear angle",
            Self::ShearPositive => "positive shear angle",
            Self::ShearNegative => "negative shear angle",
            Self::FibreStrain => "fibre strain",
            Self::FibreDeviation => "fibre deviation",
        }
    }

    /// SI unit of its values.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::WrinkleHeight | Self::WrinkleLength | Self::BridgingGap => "m",
            Self::BridgingArea => "m2",
            Self::Shear | Self::ShearPositive | Self::ShearNegative | Self::FibreDeviation => "rad",
            Self::FibreStrain => "1",
        }
    }
}

impl LimitValues {
    /// The limit on a quantity (SI), if there is one.
    pub fn of(&self, on: LimitOn) -> Option<f64> {
        match on {
            LimitOn::WrinkleHeight => self.wrinkle_height.map(Length::si),
            LimitOn::WrinkleLength => self.wrinkle_length.map(Length::si),
            LimitOn::BridgingGap => self.bridging_gap.map(Length::si),
            LimitOn::BridgingArea => self.bridging_area.map(Area::si),
            LimitOn::Shear => self.shear.map(Angle::si),
            LimitOn::ShearPositive => self.shear_positive.map(Angle::si),
            LimitOn::ShearNegative => self.shear_negative.map(Angle::si),
            LimitOn::FibreStrain => self.fibre_strain,
            LimitOn::FibreDeviation => self.fibre_deviation.map(Angle::si),
        }
    }

    /// Whether nothing is limited.
    pub fn is_empty(&self) -> bool {
        LimitOn::ALL.iter().all(|on| self.of(*on).is_none())
    }
}

impl Limits {
    /// Whether nothing is limited.
    pub fn is_empty(&self) -> bool {
        self.part.is_empty() && self.places.iter().all(|p| p.values.is_empty())
    }

    /// Whether a quantity is limited anywhere.
    pub fn limit(&self, on: LimitOn) -> bool {
        let at_places = self.places.iter().any(|p| p.values.of(on).is_some());
        at_places || self.part.of(on).is_some()
    }
}

impl LimitPlace {
    /// How it is called: its name, else what it is.
    pub fn title(&self) -> String {
        if let Some(name) = &self.name {
            return name.clone();
        }
        let shape = match (&self.region, &self.polygon, &self.rectangle) {
            (Some(region), ..) => Some(format!("region {region}")),
            (_, Some(_), _) => Some("a polygon".to_owned()),
            (_, _, Some(_)) => Some("a rectangle".to_owned()),
            _ => None,
        };
        match (shape, &self.ply) {
            (Some(shape), Some(ply)) => format!("{shape} of {ply}"),
            (Some(shape), None) => shape,
            (None, Some(ply)) => ply.clone(),
            (None, None) => "part".to_owned(),
        }
    }

    /// The corners of its own polygon or rectangle in the flat ply (m), counter-clockwise; `None` when it has neither.
    ///
    /// # Errors
    /// When it bounds nothing, has both, or is made by another step.
    pub fn corners(&self) -> Option<Result<Vec<Point>, RegionError>> {
        if self.polygon.is_none() && self.rectangle.is_none() {
            return None;
        }
        let region = PlyRegion {
            name: self.title(),
            polygon: self.polygon.clone(),
            rectangle: self.rectangle.clone(),
            friction: std::collections::BTreeMap::new(),
            stitches: None,
        };
        Some(region.corners(outline::Point::default()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read(given: serde_json::Value) -> Result<Limits, serde_json::Error> {
        serde_json::from_value(given)
    }

    #[test]
    fn limits_are_read_with_their_units_and_told_again_the_same() {
        let limits = read(json!({
            "wrinkle_height": "0.5 mm", "bridging_area": "2 cm2", "shear_negative": "-50 deg", "fibre_strain": 0.01, "fibre_deviation": "5 deg",
            "places": [{"ply": "ply_2", "region": "web", "wrinkle_length": "20 mm"},
                       {"rectangle": {"centre": ["10 mm", "0 mm"], "length": "20 mm", "width": "10 mm"}, "shear": "30 deg"}],
            "source": "drawing 7",
        }))
        .unwrap();
        let near = |on, value: f64| (limits.part.of(on).unwrap() - value).abs() < 1e-12;
        assert!(near(LimitOn::WrinkleHeight, 0.5e-3) && near(LimitOn::BridgingArea, 2e-4));
        assert!(near(LimitOn::ShearNegative, -50f64.to_radians()));
        assert!(near(LimitOn::FibreDeviation, 5f64.to_radians()));
        assert_eq!(limits.part.of(LimitOn::WrinkleLength), None);
        assert!(limits.limit(LimitOn::Shear) && !limits.limit(LimitOn::BridgingGap));
        assert_eq!(limits.places[0].title(), "region web of ply_2");
        assert!(limits.places[0].corners().is_none());
        let corners = limits.places[1].corners().unwrap().unwrap();
        let least = corners.iter().map(|c| c[0]).fold(f64::INFINITY, f64::min);
        assert!(least.abs() < 1e-12, "{corners:?}");
        let again = serde_json::to_string(&limits).unwrap();
        assert_eq!(serde_json::from_str::<Limits>(&again).unwrap(), limits);
    }

    #[test]
    fn a_key_that_is_no_limit_is_refused_at_the_part_and_at_a_place() {
        assert!(read(json!({"wrinkle_depth": "1 mm"})).is_err());
        assert!(read(json!({"places": [{"ply": "a", "wrinkel_height": "1 mm"}]})).is_err());
        assert!(read(json!({})).unwrap().is_empty());
    }

    #[test]
    fn names_are_the_keys_of_a_workflow() {
        for on in LimitOn::ALL {
            let value = match on.unit() {
                "1" => json!(0.5),
                unit => json!(format!("0 {unit}")),
            };
            let limits = read(json!({on.name(): value})).unwrap();
            let stated = LimitOn::ALL
                .into_iter()
                .filter(|o| limits.part.of(*o).is_some());
            assert_eq!(stated.collect::<Vec<_>>(), [on]);
        }
    }
}
