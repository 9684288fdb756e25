//! The rules of the interface [`Backend`](mapper_core::Backend) that every backend must keep ([`RULES`], `mapper backend check NAME`).

mod candidate;
mod rules;

pub use candidate::{Candidate, CheckResult};
pub use rules::{NotArmed, RULES, Rule, check_rules};
