//! Library of physical terms that may be missing in a balance of the model, as formulas with units and typical sizes.

pub mod balance;
pub mod expression;
pub mod law_effect;
pub mod library;
pub(crate) mod quantity;
pub mod term;
pub mod time_history;
