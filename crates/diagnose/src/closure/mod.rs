//! Discovery outside the effect library: the residual source term in each balance, its location, and a closure term for it. See `docs/explanation/gap.md` for
//! the method and its limits.

pub(crate) mod columns;
pub(crate) mod description;
pub(crate) mod discover;
pub(crate) mod expression;
pub(crate) mod library;
pub(crate) mod residual_source;
pub(crate) mod select;
pub(crate) mod term;
