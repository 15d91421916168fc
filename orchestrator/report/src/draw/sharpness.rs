//! How fine the pictures of a page are.

/// Resolution of the pictures: pixels of the image per pixel of the page.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sharpness(pub(crate) f64);

/// Below this the page says that it shows less than the artifacts have.
const COARSE: f64 = 0.8;

impl Sharpness {
    /// Those that are tried, the finest first.
    pub(crate) const ALL: [Self; 6] = [
        Self(1.6),
        Self(1.2),
        Self(0.8),
        Self(0.5),
        Self(0.35),
        Self(0.25),
    ];

    /// Whether the page shows less than the artifacts have.
    pub(crate) fn is_coarse(self) -> bool {
        self.0 < COARSE
    }

    /// The part of what a page holds with the finest pictures.
    pub(crate) fn share(self) -> f64 {
        (self.0 / Self::ALL[0].0).min(1.0)
    }
}
