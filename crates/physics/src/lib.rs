//! The lumped turbocharger model of Burke et al. for planning, simulated rigs and identification.
//!
//! [`Model`](simulation::model::Model) combines the laws in [`laws`], one file each; [`simulate`](simulation::simulate) integrates it,
//! [`steady`](simulation::steady) solves for steady states.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod compressor_map;
pub mod gas;
pub mod laws;
pub mod machine;
pub mod operating_point;
pub mod rig;
pub mod simulation;
