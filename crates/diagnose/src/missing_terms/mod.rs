//! Discovery outside the effect library: the residual source term in each balance, its location, and a law for it. See `docs/explanation/gap.md` for
//! the method and its limits.

pub mod balance;
pub mod candidate;
pub mod columns;
pub mod discover;
pub mod evidence;
pub mod expression;
pub mod force;
pub mod held_out;
pub mod law_effect;
pub mod library;
pub mod onset;
pub mod quantity;
pub mod script;
pub mod select;
pub mod sentence;
pub mod signatures;
pub mod term;
pub mod time_history;
