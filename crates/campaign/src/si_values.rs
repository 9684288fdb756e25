//! Values with their units as fields in SI, and elements of optional keys that override defaults.

use crate::units::{Dimension, Quantity};
use serde::{Deserialize, Deserializer};

/// For `deserialize_with`, together with `default`: an optional key.
pub(crate) fn optional_si<'de, D: Dimension, S: Deserializer<'de>>(
    deserializer: S,
) -> Result<Option<f64>, S::Error> {
    Option::<Quantity<D>>::deserialize(deserializer).map(|quantity| quantity.map(|given| given.value))
}

/// The value in SI, or a default.
pub(crate) fn value_or<D: Dimension>(quantity: Option<Quantity<D>>, default: f64) -> f64 {
    quantity.map_or(default, |quantity| quantity.value)
}

/// Declares an element of optional keys: for each key its description, the field of the target that it sets, if any, the kind of its value,
/// and its `schemars` attributes.
macro_rules! element {
    (
        $(#[$doc:meta])+
        $vis:vis $element:ident for $target:ty {
            $($(#[$key_doc:meta])+ $key:ident $(=> $field:ident)?: $kind:ty [$($schema:tt)*];)+
        }
    ) => {
        $(#[$doc])+
        #[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        $vis struct $element {
            $($(#[$key_doc])+ #[schemars($($schema)*)] $key: Option<$kind>,)+
        }

        impl $element {
            /// Sets the fields whose keys are given.
            fn apply(self, to: &mut $target) {
                $($($crate::units::set(&mut to.$field, self.$key);)?)+
            }
        }
    };
}
pub(crate) use element;
