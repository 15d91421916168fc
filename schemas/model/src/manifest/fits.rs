//! Whether bounds leave anything, and whether a default is a value that its parameter takes.

use super::{Bound, Bounds, Shape};
use crate::units::{Dimension, parse_quantity};
use serde_json::Value;

impl Bounds {
    /// Whether any value is within.
    pub(super) fn check(&self) -> Result<(), String> {
        let Some(most) = &self.maximum else {
            return Ok(());
        };
        let over = |b: &Option<Bound>, open: bool| {
            b.as_ref()
                .filter(|b| b.value > most.value || (open && b.value == most.value))
                .map(|b| b.text.clone())
        };
        match over(&self.minimum, false).or_else(|| over(&self.exclusive_minimum, true)) {
            Some(least) => Err(format!(
                "no value is over its smallest, {least}, and up to its `maximum`, {}",
                most.text
            )),
            None => Ok(()),
        }
    }
}

impl Shape {
    /// Whether a value, written as in YAML, is one of these; the error says what is expected. Files, scenes and components are looked at where
    /// they are used.
    pub(super) fn takes(&self, value: &Value) -> Result<(), String> {
        let within = |number: Option<f64>, bounds: &Bounds| match number {
            None => Err(self.expected()),
            Some(number) => bounds.broken_by(number).map_or(Ok(()), Err),
        };
        let met = |yes: bool| if yes { Ok(()) } else { Err(self.expected()) };
        let quantity = |d: Dimension| match value {
            Value::String(text) => parse_quantity(text, d).ok(),
            other if d == Dimension::Dimensionless => other.as_f64(),
            _ => None,
        };
        match self {
            Shape::Boolean => met(value.is_boolean()),
            Shape::Integer(b) => within(value.as_i64().map(|n| n as f64), b),
            Shape::Number(b) => within(quantity(Dimension::Dimensionless), b),
            Shape::Quantity(d, b) => within(quantity(*d), b),
            Shape::String | Shape::File => met(value.is_string()),
            Shape::Choice(values) => met(value
                .as_str()
                .is_some_and(|v| values.iter().any(|w| w == v))),
            Shape::List(of, must) => {
                let items = value.as_array().ok_or_else(|| self.expected())?;
                items.iter().try_for_each(|item| of.shape.takes(item))?;
                must.broken_by_count(items.len()).map_or(Ok(()), Err)
            }
            Shape::Map(of) => {
                let items = value.as_object().ok_or_else(|| self.expected())?;
                items.values().try_for_each(|item| of.shape.takes(item))
            }
            Shape::Object(fields) => {
                let items = value.as_object().ok_or_else(|| self.expected())?;
                items.iter().try_for_each(|(name, item)| {
                    let of = fields.get(name).ok_or_else(|| self.expected())?;
                    of.shape.takes(item)
                })
            }
            Shape::Scene { .. } | Shape::SheetMaterial | Shape::Component(_) => {
                met(value.is_string() || value.is_object())
            }
        }
    }
}
