//! Discovery outside the effect library: residual source terms of the balances, their location, a closure term. Method: `docs/explanation/gap.md`.

pub(crate) mod columns;
pub(crate) mod combine;
pub(crate) mod description;
pub(crate) mod discover;
pub(crate) mod expression;
pub(crate) mod library;
pub(crate) mod residual_source;
pub(crate) mod select;
pub(crate) mod term;
