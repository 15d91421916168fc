//! How near facets are to what they stand for.

/// Largest distance between a facet and the curved surface that it stands for (m). Facets are refined
/// along fillets and ramps to keep it, whatever `facet_size` says.
pub const CHORD_TOLERANCE: f64 = 2e-5;
