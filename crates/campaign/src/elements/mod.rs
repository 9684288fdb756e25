//! The elements of a campaign, one file each, with schema, ranges and defaults, conversion to SI, and consistency checks.
//!
//! Doc comments of deserialised types become the schema's descriptions, which editors show and messages quote: they tell the user
//! what to write. `x-quantity`, `x-min`, `x-max` and `x-above` are explained at [`crate::units::Quantity`].
//!
//! If the program's own struct is in `mapper-core`, the element is its `serde` remote: the compiler compares the
//! fields of both.

pub(crate) mod acceptance;
pub(crate) mod grid;
pub(crate) mod identification;
pub(crate) mod output;
pub(crate) mod repeats;
pub(crate) mod rig;
pub(crate) mod timing;
pub(crate) mod tolerances;
pub(crate) mod turbocharger;
