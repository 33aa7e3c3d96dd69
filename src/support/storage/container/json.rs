//! JSON without duplicate keys: one text, one meaning for every reader.

use crate::scalar::Scalar;
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fmt;

/// Any JSON value in which no object names a key twice.
struct Unambiguous;

/// Checks that no object in `text` names a key twice, at any depth.
pub(crate) fn check_unambiguous(text: &[u8]) -> Result<(), serde_json::Error> {
    serde_json::from_slice::<Unambiguous>(text).map(|_| ())
}

impl<'de> Deserialize<'de> for Unambiguous {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Unambiguous)
    }
}

impl<'de> Visitor<'de> for Unambiguous {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self, A::Error> {
        let mut seen = HashSet::new();
        while let Some(key) = map.next_key::<String>()? {
            if seen.contains(&key) {
                return Err(serde::de::Error::custom(format_args!("duplicate key {key:?}")));
            }
            map.next_value::<Unambiguous>()?;
            seen.insert(key);
        }
        Ok(self)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self, A::Error> {
        while seq.next_element::<Unambiguous>()?.is_some() {}
        Ok(self)
    }
    fn visit_bool<E>(self, _: bool) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_i64<E>(self, _: i64) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_u64<E>(self, _: u64) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_f64<E>(self, _: f64) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_str<E>(self, _: &str) -> Result<Self, E> {
        Ok(self)
    }
    fn visit_unit<E>(self) -> Result<Self, E> {
        Ok(self)
    }
}

/// Number type of stored numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StoredPrecision {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl StoredPrecision {
    /// That of a number type, if files know it.
    pub(crate) fn of<S: Scalar>() -> Option<Self> {
        [Self::F32, Self::F64].into_iter().find(|precision| precision.name() == S::NAME)
    }
    /// `"f32"` or `"f64"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::check_unambiguous;

    #[test]
    fn duplicates_are_found_at_any_depth() {
        assert!(check_unambiguous(br#"{"a": [1, -2.5, null, true, "x", {"b": {}}], "b": 1}"#).is_ok());
        assert!(check_unambiguous(br#"{"a": 1, "a": 2}"#).is_err());
        assert!(check_unambiguous(br#"{"c": [{"a": 1, "\u0061": 2}]}"#).is_err());
        assert!(check_unambiguous("[".repeat(100_000).as_bytes()).is_err());
    }
}
