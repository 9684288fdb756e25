//! Discovery outside the effect library: the residual source term in each balance, its location, and a law for it. See `docs/explanation/gap.md` for
//! the method and its limits.

pub mod discover;
pub mod imitations;
pub mod laws;
pub mod search;
pub mod terms;
