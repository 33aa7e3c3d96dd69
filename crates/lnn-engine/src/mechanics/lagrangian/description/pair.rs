//! Pairs of numbers in a file: a list of exactly two. For a list of fixed length, serde ignores additional elements.

use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;
use serde::Deserialize;
use serde::de::{Deserializer, Error};

/// A list of exactly two elements.
struct Pair<T>([T; 2]);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Pair<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let found = Vec::<T>::deserialize(deserializer)?;
        let length = found.len();
        found.try_into().map(Self).map_err(|_| D::Error::invalid_length(length, &"an array of length 2"))
    }
}

/// Reads a pair.
pub(crate) fn one<'de, T: Deserialize<'de>, D: Deserializer<'de>>(deserializer: D) -> Result<[T; 2], D::Error> {
    Pair::deserialize(deserializer).map(|Pair(pair)| pair)
}

/// Reads an optional pair.
pub fn optional<'de, T: Deserialize<'de>, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[T; 2]>, D::Error> {
    Ok(Option::<Pair<T>>::deserialize(deserializer)?.map(|Pair(pair)| pair))
}

/// Reads a list of pairs.
pub fn list<'de, T: Deserialize<'de>, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<[T; 2]>, D::Error> {
    Ok(Vec::<Pair<T>>::deserialize(deserializer)?.into_iter().map(|Pair(pair)| pair).collect())
}

/// Reads pairs by name.
pub(crate) fn by_name<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<String, [T; 2]>, D::Error> {
    let found = BTreeMap::<String, Pair<T>>::deserialize(deserializer)?;
    Ok(found.into_iter().map(|(name, Pair(pair))| (name, pair)).collect())
}
