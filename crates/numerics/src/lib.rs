//! General numerical methods for the physics and inference crates: [`statistics`], coloured noise, damped least squares, mixed models,
//! minima and roots of scalar functions, and parallel work.
//!
//! This crate uses no other crate of the workspace. It adds only what libraries do not offer: rayon distributes the work, nalgebra solves
//! linear equations, statrs has the distributions.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

/// Relative tolerance of an iteration: the square root of the rounding error of f64 (Press et al., Numerical Recipes, ch. 10.1).
pub const ROUNDING: f64 = 1.490_116_119_384_765_6e-8;
/// Relative step of a difference: the cube root of that error, at which rounding and curvature are equal in a two-sided one (ibid., ch. 5.7).
pub const SLOPE_STEP: f64 = 6.055_454_452_393_343e-6;

pub mod coloured_noise;
pub mod least_squares;
pub mod minimise;
pub mod mixed_model;
pub mod parallel;
pub mod polyline;
pub mod root;
pub mod statistics;
