//! Discovery outside the effect library: the residual source term in each balance, its location, and a closure term for it. See `docs/explanation/gap.md` for
//! the method and its limits.

pub mod balance;
pub(crate) mod candidate;
pub mod columns;
pub mod confounding;
pub mod description;
pub mod discover;
pub mod expression;
pub mod library;
pub mod residual_source;
pub(crate) mod select;
pub mod term;
