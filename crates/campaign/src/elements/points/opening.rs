//! The opening of the back-pressure valve, in the form used by all elements.

use schemars::JsonSchema;
use serde::Deserialize;

/// Opening of the back-pressure valve relative to its nominal area, a plain number above 0, at most 2.5.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub(crate) struct Opening(
    #[schemars(range(max = 2.5), extend("exclusiveMinimum" = 0), example = 0.5)] pub(crate) f64,
);
