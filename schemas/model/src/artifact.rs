//! What the steps tell each other: the attributes of every kind of artifact, as one step writes and another reads them.
//!
//! A kind has one type here, and each rule about it stands beside that type. So a changed field is a compile error in all that write it and read it.
//! All numbers are SI. `schemas/json/artifacts.schema.json` is the JSON Schema of these types, and `schemas/data-model.md` describes them together with the
//! bodies, fields and arrays of an artifact.
//!
//! A plugin of somebody else may tell more than a type has: readers pass over what they do not know, and what is handed on from one artifact to
//! the next ([`Sheet`], [`Zone`]) keeps it. What a type has as an `Option` or a list may be left out.

mod attributes;
mod boundary;
mod census;
mod characterisation;
mod comparison;
mod confirmation;
mod conformance;
mod coupon;
mod defects;
mod export;
mod forming;
mod geometry;
mod measurement;
mod mesh_study;
mod shear_limits;
mod shown;
mod study_table;
mod zones;

pub use attributes::Attributes;
pub use boundary::{Boundary, Feedback};
pub use census::{
    Census, CensusBody, CensusCircle, CensusComparison, CensusCurve, CensusRun, CensusRunBody,
    CrossSection, SectionWrinkle, Wrinkle,
};
pub use characterisation::Characterisation;
pub use comparison::{
    Cause, ComparedBody, ComparedDefect, ComparedModel, Comparison, Cut, Defect, DefectKind, Layer,
    Passage, PlyShear, Role, Strip, Way, Work, Yardstick,
};
pub use confirmation::{
    ConfirmVariant, Confirmation, ConfirmedDefect, ConfirmedSize, ConfirmedVerdict, HangsOn,
    JudgedBounds, NewDefect, Stands, Variation,
};
pub use conformance::{
    CONFORMANCE_MARK, CheckOutcome, Conformance, ConformanceCheck, ConformanceLine,
    ConformanceRule, ConformanceSubject,
};
pub use coupon::{Coupon, ElementCount, SpecimenBody};
pub use defects::{Defects, PlyDefects, Thresholds};
pub use export::Export;
pub use forming::{
    Depth, DepthPeak, Energy, FieldError, Forming, MeshQuality, POOR_JACOBIAN, Penetration,
    PenetrationPeak, PlainBody, RegionFacts, RigidBody, Sheet, SheetBody, ToolPlacement,
};
pub use geometry::Geometry;
pub use measurement::{
    Compressed, FamilyCompression, FibreCompression, MeasuredBody, MeasuredDefect, Measurement,
    PlySlip, ScanAgreement, ScanAlignment, ScanDefect, Section, SectionOn, SlipCourse, SlipPair,
    SlipSection,
};
pub use mesh_study::{MeshStudy, ZoneAdvice};
pub use shear_limits::ShearLimits;
pub use shown::{Axis, CarriedFile, Cell, Column, Map, Panel, Paths, Plot, Series, Style, Table};
pub use study_table::{
    StudyBest, StudyFailure, StudyKeys, StudyOptimisation, StudyOrigin, StudyResponse,
    StudySamples, StudyTable, StudyValue, StudyVariable,
};
pub use zones::{Rectangle, Zone, Zones, area, current_zones, which_count};
