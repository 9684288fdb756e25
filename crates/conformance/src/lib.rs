//! The conformance kit of the seam [`Backend`](mapper_core::Backend): rules that every backend keeps, as checks that anybody can
//! run ([`RULES`], `mapper backend check NAME`), and a backend that misbehaves on demand ([`Misbehaving`]), so that what drives
//! a rig can be tried against every fault.

mod candidate;
mod misbehaving;
mod rules;

pub use candidate::{Candidate, Checked};
pub use misbehaving::{Fault, Misbehaving};
pub use rules::{NotArmed, RULES, Rule, judge};
