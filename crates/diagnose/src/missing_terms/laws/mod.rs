//! Closure terms as results: their fit, description, effect script, and gap reduction on held-out steps.

pub(crate) mod candidate;
pub mod script;
pub mod sentence;
