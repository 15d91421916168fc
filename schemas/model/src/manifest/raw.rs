//! Declarations of parameters as they stand in a manifest, and what they mean.

use super::{Bound, Bounds, Declaration, Items, Order, PluginKind, Shape, is_false, unique};
use crate::units::{Dimension, parse_quantity, si_number};
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A declaration as it stands in the manifest: every key of every type, checked on conversion.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDeclaration {
    r#type: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    doc: String,
    #[serde(default, skip_serializing_if = "is_false")]
    required: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    default: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dimension: Option<Dimension>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    values: Option<Vec<String>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    of: Option<Box<Declaration>>,
    #[serde(
        default,
        deserialize_with = "unique::keys_if_any",
        skip_serializing_if = "Option::is_none"
    )]
    fields: Option<IndexMap<String, Declaration>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    minimum: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    maximum: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    exclusive_minimum: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    minimum_items: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    maximum_items: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    order: Option<Order>,
    #[serde(default, skip_serializing_if = "is_false")]
    straight_fibres: bool,
}

impl RawDeclaration {
    /// Refuses keys that the type has no use for: in a manifest they are a slip.
    fn only(&self, allowed: &[&str]) -> Result<(), String> {
        let present = [
            ("dimension", self.dimension.is_some()),
            ("values", self.values.is_some()),
            ("of", self.of.is_some()),
            ("fields", self.fields.is_some()),
            ("minimum", self.minimum.is_some()),
            ("maximum", self.maximum.is_some()),
            ("exclusive_minimum", self.exclusive_minimum.is_some()),
            ("minimum_items", self.minimum_items.is_some()),
            ("maximum_items", self.maximum_items.is_some()),
            ("order", self.order.is_some()),
            ("straight_fibres", self.straight_fibres),
        ];
        match present
            .iter()
            .find(|(name, is)| *is && !allowed.contains(name))
        {
            Some((name, _)) => Err(format!(
                "`{name}` has no meaning for type `{}`",
                self.r#type
            )),
            None => Ok(()),
        }
    }

    fn bounds(&self, dimension: Option<Dimension>) -> Result<Bounds, String> {
        let read = |value: &Option<Value>| -> Result<Option<Bound>, String> {
            let Some(value) = value else { return Ok(None) };
            let number = |v: f64| Bound {
                value: v,
                text: si_number(v),
            };
            match (value, dimension) {
                (Value::String(text), Some(d)) => parse_quantity(text, d)
                    .map(|value| {
                        Some(Bound {
                            value,
                            text: text.clone(),
                        })
                    })
                    .map_err(|e| e.to_string()),
                (Value::Number(n), None | Some(Dimension::Dimensionless)) => {
                    Ok(n.as_f64().map(number))
                }
                (_, Some(d)) => Err(format!("bound {value} must be {}", d.with_article())),
                (_, None) => Err(format!("bound {value} must be a number")),
            }
        };
        Ok(Bounds {
            minimum: read(&self.minimum)?,
            maximum: read(&self.maximum)?,
            exclusive_minimum: read(&self.exclusive_minimum)?,
        })
    }
}

const BOUNDS: [&str; 3] = ["minimum", "maximum", "exclusive_minimum"];

impl TryFrom<RawDeclaration> for Declaration {
    type Error = String;

    /// Long, as it goes through the types of a parameter once, each with the keys that it allows.
    fn try_from(raw: RawDeclaration) -> Result<Self, String> {
        let missing = |key: &str| format!("type `{}` needs `{key}`", raw.r#type);
        let (shape, allowed): (Shape, &[&str]) = match raw.r#type.as_str() {
            "boolean" => (Shape::Boolean, &[]),
            "integer" => (Shape::Integer(raw.bounds(None)?), &BOUNDS),
            "number" => (Shape::Number(raw.bounds(None)?), &BOUNDS),
            "string" => (Shape::String, &[]),
            "choice" => {
                let values = raw.values.clone().filter(|v| !v.is_empty());
                (
                    Shape::Choice(values.ok_or_else(|| missing("values"))?),
                    &["values"],
                )
            }
            "quantity" => {
                let d = raw.dimension.ok_or_else(|| missing("dimension"))?;
                let allowed = &["dimension", "minimum", "maximum", "exclusive_minimum"];
                (Shape::Quantity(d, raw.bounds(Some(d))?), allowed)
            }
            "list" => {
                let items = Items {
                    minimum: raw.minimum_items,
                    maximum: raw.maximum_items,
                    order: raw.order,
                };
                items.check()?;
                let of = raw.of.clone().ok_or_else(|| missing("of"))?;
                if items.order.is_some() && !of.shape.is_number() {
                    return Err("`order` has no meaning for items that are no numbers".into());
                }
                (
                    Shape::List(of, items),
                    &["of", "minimum_items", "maximum_items", "order"],
                )
            }
            "map" => (
                Shape::Map(raw.of.clone().ok_or_else(|| missing("of"))?),
                &["of"],
            ),
            "object" => (
                Shape::Object(raw.fields.clone().ok_or_else(|| missing("fields"))?),
                &["fields"],
            ),
            "scene" => {
                let straight_fibres = raw.straight_fibres;
                (Shape::Scene { straight_fibres }, &["straight_fibres"])
            }
            "sheet_material" => (Shape::SheetMaterial, &[]),
            "file" => (Shape::File, &[]),
            "element" => (Shape::Component(PluginKind::Element), &[]),
            "material" => (Shape::Component(PluginKind::Material), &[]),
            other => return Err(format!("unknown parameter type `{other}`")),
        };
        raw.only(allowed)?;
        if let Shape::Integer(b) | Shape::Number(b) | Shape::Quantity(_, b) = &shape {
            b.check()?;
        }
        if let Some(default) = &raw.default {
            if raw.required {
                return Err("a parameter with a `default` cannot be `required`".into());
            }
            let wrong = |expected| format!("`default` is {default}; expected {expected}");
            shape.takes(default).map_err(wrong)?;
        }
        Ok(Declaration {
            doc: raw.doc,
            required: raw.required,
            default: raw.default,
            shape,
        })
    }
}

impl From<Declaration> for RawDeclaration {
    /// Long, as it goes through the types of a parameter once.
    fn from(d: Declaration) -> Self {
        let mut raw = RawDeclaration {
            doc: d.doc,
            required: d.required,
            default: d.default,
            ..RawDeclaration::default()
        };
        let mut bounded = |bounds: Bounds, as_text: bool| {
            let value = |b: Option<Bound>| {
                b.map(|b| {
                    if as_text {
                        Value::from(b.text)
                    } else {
                        Value::from(b.value)
                    }
                })
            };
            raw.minimum = value(bounds.minimum);
            raw.maximum = value(bounds.maximum);
            raw.exclusive_minimum = value(bounds.exclusive_minimum);
        };
        raw.r#type = match d.shape {
            Shape::Boolean => "boolean",
            Shape::Integer(b) => {
                bounded(b, false);
                "integer"
            }
            Shape::Number(b) => {
                bounded(b, false);
                "number"
            }
            Shape::String => "string",
            Shape::Choice(values) => {
                raw.values = Some(values);
                "choice"
            }
            Shape::Quantity(dimension, b) => {
                bounded(b, dimension != Dimension::Dimensionless);
                raw.dimension = Some(dimension);
                "quantity"
            }
            Shape::List(of, items) => {
                raw.minimum_items = items.minimum;
                raw.maximum_items = items.maximum;
                raw.order = items.order;
                raw.of = Some(of);
                "list"
            }
            Shape::Map(of) => {
                raw.of = Some(of);
                "map"
            }
            Shape::Object(fields) => {
                raw.fields = Some(fields);
                "object"
            }
            Shape::Scene { straight_fibres } => {
                raw.straight_fibres = straight_fibres;
                "scene"
            }
            Shape::SheetMaterial => "sheet_material",
            Shape::File => "file",
            Shape::Component(kind) => kind.name(),
        }
        .into();
        raw
    }
}
