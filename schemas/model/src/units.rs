//! Quantities: text with a unit outside (`"5 mm"`), SI numbers inside.
//!
//! A bare number where a unit is needed is an error, zero included: `0` says nothing about what was
//! meant. Powers of ten are applied to the decimal text before it becomes binary, so that `10 mm`,
//! `1 cm` and `0.01 m` are the same bits and give the same content key.

mod dimension;
mod parse;
mod quantity;
mod symbols;

pub use dimension::{Dimension, Exponents, UnitError, si_number, si_text};
pub use parse::{
    Digits, SiError, Unit, check_si, digits, parse_quantity, parse_quantity_in, parse_unit,
    parse_unit_of, plain_number,
};
pub use quantity::{
    Acceleration, Angle, Area, ArealMass, Curvature, Density, Energy, Force, ForcePerLength,
    Frequency, Length, Mass, Moment, Number, Pressure, QUANTITY_PATTERN, Temperature, Time,
    Velocity, Volume, quantity_schema,
};
