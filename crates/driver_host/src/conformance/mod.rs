//! The conformance kit of the interface [`Backend`](mapper_core::Backend): rules that every backend must keep ([`RULES`],
//! `mapper backend check NAME`), and a backend with faults on demand ([`FaultyBackend`]) to test programs that control a rig.

mod candidate;
mod faulty_backend;
mod rules;

pub use candidate::{Candidate, CheckResult};
pub use faulty_backend::{Fault, FaultyBackend};
pub use rules::{NotArmed, RULES, Rule, check_rules};
