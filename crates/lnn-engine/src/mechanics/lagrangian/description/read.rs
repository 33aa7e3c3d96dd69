//! Reads the numbers of a description from a file.

use super::events::{Consequence, Word};
use super::measured::MeasuredDescription;
use super::quantity::{Decimal, Quantity};
use super::{ParameterDescription, Per};
use crate::lagrangian::expression::quantity;
use crate::lagrangian::system::Range;
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use core::fmt;
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{Deserializer, Error, MapAccess, Visitor};

/// Reads a number or a text as text.
struct Written(&'static str);

impl Visitor<'_> for Written {
    type Value = String;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
    fn visit_f64<E: Error>(self, value: f64) -> Result<String, E> {
        // This text parses to the same number; the grammar has no sign `+` in an exponent.
        Ok(value.to_string())
    }
    fn visit_i64<E: Error>(self, value: i64) -> Result<String, E> {
        Ok(value.to_string())
    }
    fn visit_u64<E: Error>(self, value: u64) -> Result<String, E> {
        Ok(value.to_string())
    }
    fn visit_str<E: Error>(self, value: &str) -> Result<String, E> {
        Ok(value.to_string())
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = deserializer.deserialize_any(Written("a number or a formula of numbers such as \"2*pi\""))?;
        quantity(&text).map(Self).map_err(D::Error::custom)
    }
}

impl<'de> Deserialize<'de> for Decimal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written("a number, or a decimal number as text")).map(Self)
    }
}

/// Reads the name or the number of a link as text.
pub(super) fn reference<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    deserializer.deserialize_any(Written("the name or the number of a link")).map(Some)
}

/// The table of a parameter.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterTable {
    default: Decimal,
    #[serde(default = "super::one")]
    unit: String,
    #[serde(default)]
    range: Range,
    #[serde(default)]
    learn: bool,
    per: Option<Per>,
    #[serde(default)]
    known: BTreeMap<String, Decimal>,
}

struct NumberOrTable;

impl<'de> Visitor<'de> for NumberOrTable {
    type Value = ParameterDescription;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or a table { default, unit, range, learn, per, known }")
    }
    fn visit_f64<E: Error>(self, value: f64) -> Result<ParameterDescription, E> {
        Ok(alone(value.to_string()))
    }
    fn visit_i64<E: Error>(self, value: i64) -> Result<ParameterDescription, E> {
        Ok(alone(value.to_string()))
    }
    fn visit_u64<E: Error>(self, value: u64) -> Result<ParameterDescription, E> {
        Ok(alone(value.to_string()))
    }
    fn visit_str<E: Error>(self, value: &str) -> Result<ParameterDescription, E> {
        Ok(alone(value.to_string()))
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ParameterDescription, A::Error> {
        let ParameterTable { default, unit, range, learn, per, known } =
            ParameterTable::deserialize(MapAccessDeserializer::new(map))?;
        if per.is_none() && !known.is_empty() {
            return Err(A::Error::custom("known: values by trajectory need `per = \"trajectory\"`"));
        }
        Ok(ParameterDescription { default, unit, range, learn, per, known })
    }
}

fn alone(default: String) -> ParameterDescription {
    ParameterDescription {
        default: Decimal(default),
        unit: super::one(),
        range: Range::Any,
        learn: false,
        per: None,
        known: BTreeMap::new(),
    }
}

impl<'de> Deserialize<'de> for ParameterDescription {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberOrTable)
    }
}

/// The table of a measured quantity.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeasuredTable {
    formula: String,
    #[serde(default = "super::one")]
    unit: String,
    column: Option<String>,
    error: Option<String>,
    #[serde(default)]
    periodic: bool,
}

struct FormulaOrTable;

impl<'de> Visitor<'de> for FormulaOrTable {
    type Value = MeasuredDescription;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a formula as text, or a table { formula, unit, column, error, periodic }")
    }
    fn visit_str<E: Error>(self, value: &str) -> Result<MeasuredDescription, E> {
        let (formula, unit) = (value.to_string(), super::one());
        Ok(MeasuredDescription { formula, unit, column: None, error: None, periodic: false })
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<MeasuredDescription, A::Error> {
        let MeasuredTable { formula, unit, column, error, periodic } =
            MeasuredTable::deserialize(MapAccessDeserializer::new(map))?;
        Ok(MeasuredDescription { formula, unit, column, error, periodic })
    }
}

impl<'de> Deserialize<'de> for MeasuredDescription {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FormulaOrTable)
    }
}

/// The table of an impact.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ImpactTable {
    restitution: Decimal,
}

struct WordOrTable;

impl<'de> Visitor<'de> for WordOrTable {
    type Value = Consequence;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"mark\", \"stop\", or a table { restitution }")
    }
    fn visit_str<E: Error>(self, value: &str) -> Result<Consequence, E> {
        Word::deserialize(StrDeserializer::new(value)).map(Consequence::Named)
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Consequence, A::Error> {
        let ImpactTable { restitution } = ImpactTable::deserialize(MapAccessDeserializer::new(map))?;
        Ok(Consequence::Impact { restitution })
    }
}

impl<'de> Deserialize<'de> for Consequence {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WordOrTable)
    }
}
