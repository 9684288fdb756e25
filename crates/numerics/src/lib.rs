//! General numerical methods for the physics and inference crates: [`statistics`], coloured noise, damped least squares,
//! minima and roots of scalar functions, and parallel work.
//!
//! This crate uses no other crate of the workspace. rayon distributes the work, nalgebra solves linear equations, and statrs has the
//! distributions; the crate adds the methods that no library offers.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

/// Relative tolerance of an iteration. Source: the square root of the rounding error of f64 (Press et al., Numerical Recipes, ch. 10.1).
pub const ROUNDING: f64 = 1.490_116_119_384_765_6e-8;
/// Relative step of a central difference. Source: the cube root of the rounding error, which balances rounding and curvature (ibid., ch.
/// 5.7).
pub const SLOPE_STEP: f64 = 6.055_454_452_393_343e-6;

pub mod coloured_noise;
pub mod least_squares;
pub mod parallel;
pub mod polyline;
pub mod root;
pub mod statistics;
