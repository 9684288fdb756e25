//! Converts a value with its unit to a field in SI.

use crate::units::{Dimension, Quantity};
use serde::{Deserialize, Deserializer};

/// For `deserialize_with`: a required key, or one whose default is in the struct.
///
/// # Errors
/// The deserialiser's error, if the text is not a value of the dimension.
pub(crate) fn si<'de, D: Dimension, S: Deserializer<'de>>(deserializer: S) -> Result<f64, S::Error> {
    Quantity::<D>::deserialize(deserializer).map(|quantity| quantity.value)
}

/// For `deserialize_with`, together with `default`: an optional key.
///
/// # Errors
/// As [`si`].
pub(crate) fn optional_si<'de, D: Dimension, S: Deserializer<'de>>(
    deserializer: S,
) -> Result<Option<f64>, S::Error> {
    Option::<Quantity<D>>::deserialize(deserializer).map(|quantity| quantity.map(|given| given.value))
}

/// The value in SI, or a default.
pub(crate) fn value_or<D: Dimension>(quantity: Option<Quantity<D>>, default: f64) -> f64 {
    quantity.map_or(default, |quantity| quantity.value)
}
