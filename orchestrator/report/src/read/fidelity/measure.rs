//! The errors that a way is judged by.

/// A measure of how wrong a way is: a result of `comparison`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// Mean error of the reference's defects and of false ones, a missed and a false one counting as 1.
    Defects,
    /// Mean relative error of the lengths of wrinkles that both have.
    Length,
    /// The same of their amplitudes.
    Amplitude,
    /// Mean relative error of the areas of bridging that both have.
    BridgingArea,
    /// Root mean square distance of material points from where the reference has them (m).
    Position,
    /// Root mean square difference of the distance from the tool (m).
    Distance,
    /// Largest difference of the quantiles of the shear angle (rad).
    Shear,
    /// Total errors of lengths and areas, by the numbers of wrinkles and of places of bridging.
    TotalDefects,
    /// All that differs in the lengths of wrinkles, with what is missed or false, over the lengths that the reference has.
    TotalLength,
    /// The same of their amplitudes, each by the wrinkle's length.
    TotalAmplitude,
    /// The same of the areas of bridging.
    TotalBridgingArea,
}

impl Measure {
    /// How many there are.
    pub const COUNT: usize = 11;

    /// All, in the order in which a way has them.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Defects,
        Self::Length,
        Self::Amplitude,
        Self::BridgingArea,
        Self::Position,
        Self::Distance,
        Self::Shear,
        Self::TotalDefects,
        Self::TotalLength,
        Self::TotalAmplitude,
        Self::TotalBridgingArea,
    ];

    /// Name of the result that holds it, without the model.
    #[must_use]
    pub fn result(self) -> &'static str {
        match self {
            Self::Defects => "defect_error",
            Self::Length => "wrinkle_length_error",
            Self::Amplitude => "wrinkle_amplitude_error",
            Self::BridgingArea => "bridging_area_error",
            Self::Position => "position_error",
            Self::Distance => "distance_error",
            Self::Shear => "shear_quantile_error",
            Self::TotalDefects => "defect_total_error",
            Self::TotalLength => "wrinkle_length_total_error",
            Self::TotalAmplitude => "wrinkle_amplitude_total_error",
            Self::TotalBridgingArea => "bridging_area_total_error",
        }
    }

    /// What it is the error of, for people.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Defects => "Error of defects, mean",
            Self::Length => "Error of wrinkle lengths, mean",
            Self::Amplitude => "Error of wrinkle amplitudes, mean",
            Self::BridgingArea => "Error of bridging areas, mean",
            Self::Position => "Error of position",
            Self::Distance => "Error of distance from the tool",
            Self::Shear => "Error of shear quantiles",
            Self::TotalDefects => "Error of defects, total",
            Self::TotalLength => "Error of wrinkle lengths, total",
            Self::TotalAmplitude => "Error of wrinkle amplitudes, total",
            Self::TotalBridgingArea => "Error of bridging areas, total",
        }
    }

    /// Its SI unit.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position | Self::Distance => "m",
            Self::Shear => "rad",
            _ => "1",
        }
    }

    /// The total that stands beside a mean over pairs.
    #[must_use]
    pub fn total(self) -> Option<Self> {
        match self {
            Self::Defects => Some(Self::TotalDefects),
            Self::Length => Some(Self::TotalLength),
            Self::Amplitude => Some(Self::TotalAmplitude),
            Self::BridgingArea => Some(Self::TotalBridgingArea),
            _ => None,
        }
    }
}
