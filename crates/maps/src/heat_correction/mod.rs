//! Corrects the apparent efficiencies of a hot map for heat, estimated from the map alone (after Sirakov and Casey).
//!
//! M. Sirakov and M. Casey, "Evaluation of heat transfer effects on turbocharger performance" (ASME GT2011-45887; J. Turbomach.
//! 135(2) 021011, 2013): by Euler's equation the work coefficient of a wheel is one function of the flow coefficient at its exit at
//! all speeds. Heat counts as work and raises slow lines above that curve, since work falls with the square of speed and flow with speed.
//! The estimate is the heat that makes all lines one curve.
//!
//! Here the curve is `a + b phi2 + k/phi1` (Euler with slip and backsweep; disc friction and recirculation) and the heat is in watts at
//! the map's reference state. Robust least squares of relative residuals estimates all of them together. Limits of the
//! method (docs/reference/maps.md): work that grows at low speed for other reasons counts as heat, and heat that fast lines lose to the
//! housing is ignored. The standard errors allow for both with round numbers: half the heat, and one point of efficiency.

mod apply;
mod error;
mod estimate;
mod work;

pub use apply::{CorrectedLine, HeatCorrection, correct_for_heat};
pub use error::HeatCorrectionError;
