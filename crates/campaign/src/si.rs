//! From a value written with its unit straight into a field in SI.

use crate::units::{Dimension, Quantity};
use serde::{Deserialize, Deserializer};

/// For `deserialize_with`: a key that has to be there, or whose default the struct knows.
///
/// # Errors
/// The deserialiser's, where the text is not a value of the dimension.
pub(crate) fn si<'de, D: Dimension, S: Deserializer<'de>>(deserializer: S) -> Result<f64, S::Error> {
    Quantity::<D>::deserialize(deserializer).map(|quantity| quantity.inside)
}

/// For `deserialize_with`, beside `default`: a key that may be left out.
///
/// # Errors
/// As [`si`].
pub(crate) fn si_if_given<'de, D: Dimension, S: Deserializer<'de>>(
    deserializer: S,
) -> Result<Option<f64>, S::Error> {
    Option::<Quantity<D>>::deserialize(deserializer).map(|quantity| quantity.map(|given| given.inside))
}

/// The value in SI, or a default.
pub(crate) fn or<D: Dimension>(quantity: Option<Quantity<D>>, default: f64) -> f64 {
    quantity.map_or(default, |quantity| quantity.inside)
}

/// Overwrites a default with what the file says.
pub(crate) fn set<D: Dimension>(target: &mut f64, quantity: Option<Quantity<D>>) {
    *target = or(quantity, *target);
}
