//! General numerical methods for the physics and inference crates: [`statistics`], coloured noise, damped least squares, mixed models,
//! minima and roots of scalar functions, and parallel work.
//!
//! This crate uses no other crate of the workspace. It adds only what libraries do not offer: rayon distributes the work, nalgebra solves
//! linear equations, statrs has the distributions.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod coloured_noise;
pub mod least_squares;
pub mod minimise;
pub mod mixed_model;
pub mod parallel;
pub mod polyline;
pub mod root;
pub mod statistics;
