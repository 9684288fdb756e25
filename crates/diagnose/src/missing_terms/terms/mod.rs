//! Library of physical terms that a balance of the model may lack, as formulas with units and typical sizes.

pub mod balance;
pub mod expression;
pub mod law_effect;
pub mod library;
pub mod quantity;
pub mod term;
pub mod time_history;
