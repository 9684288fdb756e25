//! A value with its unit in a YAML file.

use super::{Dimension, Kind, parse};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, de};
use std::{borrow::Cow, marker::PhantomData};

/// A value written with its unit, e.g. `110 krpm`.
///
/// In the schema it is a string with a pattern, an example and `x-quantity`, the kind's key. A field narrows its
/// range with `x-min`, `x-max` (both inclusive) and `x-above` (exclusive), written with units as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity<D> {
    /// The value in SI units, except shaft speed in rpm.
    pub value: f64,
    dimension: PhantomData<D>,
}

impl<D: Dimension> Quantity<D> {
    /// A quantity from its value in SI units, except shaft speed in rpm.
    pub fn new(value: f64) -> Self {
        Quantity { value, dimension: PhantomData }
    }
}

/// Overrides a default with the value of a file, if there is one.
pub fn set<T>(target: &mut T, given: Option<impl Into<T>>) {
    if let Some(given) = given {
        *target = given.into();
    }
}

impl<D> From<Quantity<D>> for f64 {
    /// The value in SI units, except shaft speed in rpm.
    fn from(quantity: Quantity<D>) -> f64 {
        quantity.value
    }
}

impl<D> From<Quantity<D>> for Option<f64> {
    fn from(quantity: Quantity<D>) -> Option<f64> {
        Some(quantity.value)
    }
}

impl<'de, D: Dimension> Deserialize<'de> for Quantity<D> {
    fn deserialize<S: Deserializer<'de>>(deserializer: S) -> Result<Self, S::Error> {
        let text = String::deserialize(deserializer)?;
        parse(D::KIND, &text)
            .map(Self::new)
            .map_err(|error| de::Error::custom(format!("{error}; {}", error.remedy(D::KIND))))
    }
}

impl<D: Dimension> JsonSchema for Quantity<D> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        D::KIND.key().into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "pattern": pattern(D::KIND),
            "examples": [D::KIND.example()],
            "x-quantity": D::KIND.key(),
        })
    }
}

/// A regular expression for editors; the parser decides.
fn pattern(kind: Kind) -> String {
    let units: Vec<String> =
        kind.units().iter().flat_map(|unit| unit.spellings).map(|spelling| escape(spelling)).collect();
    format!(r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*({})\s*$", units.join("|"))
}

fn escape(spelling: &str) -> String {
    let mut escaped = String::new();
    for c in spelling.chars() {
        match c {
            ' ' => escaped.push_str(r"\s+"),
            '^' | '*' | '(' | ')' | '/' => escaped.extend(['\\', c]),
            _ => escaped.push(c),
        }
    }
    escaped
}
