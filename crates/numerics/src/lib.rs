//! Numerics that know nothing of machines: statistics, noise with memory, damped least squares, minima and roots of
//! scalar functions, nearest places, and work spread over the cores.
//!
//! A leaf: no other crate of the workspace is used here. What a library does as well is the library's: rayon shares the
//! work, nalgebra solves the equations, statrs has the distributions.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod coloured_noise;
pub mod least_squares;
pub mod minimise;
pub mod mixed_model;
pub mod parallel;
pub mod polyline;
pub mod root;
pub mod statistics;
