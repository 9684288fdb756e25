//! The lumped turbocharger model of Burke et al., and the laws it consists of.
//!
//! One file per law; [`model`](simulation::model) combines them, [`simulate`](simulation::simulate) integrates them,
//! [`steady`](simulation::steady) finds steady states.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod compressor_map;
pub mod gas;
pub mod laws;
pub mod machine;
pub mod operating_point;
pub mod rig;
pub mod simulation;
