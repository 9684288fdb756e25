//! The conformance kit of the interface [`Backend`](mapper_core::Backend). Its rules are checks that every backend must pass
//! ([`RULES`], `mapper backend check NAME`). A backend with faults on demand ([`Misbehaving`]) tests software that drives a rig
//! against every fault.

mod candidate;
mod misbehaving;
mod rules;

pub use candidate::{Candidate, Checked};
pub use misbehaving::{Fault, Misbehaving};
pub use rules::{NotArmed, RULES, Rule, judge};
