//! Apparent efficiencies of a hot map, corrected for a heat that the map itself shows: in the manner of Sirakov and Casey.
//!
//! M. Sirakov and M. Casey, "Evaluation of heat transfer effects on turbocharger performance" (ASME GT2011-45887; J. Turbomach.
//! 135(2) 021011, 2013): by Euler's equation the work coefficient of a wheel is one curve of the flow coefficient at its exit,
//! whatever the speed; heat counts as work and lifts slow lines off that curve, since the wheel's work falls with the square of speed
//! and its flow with speed. One heat for the whole map is what makes the lines one curve again; nothing else need be known.
//!
//! Here the curve is `a + b phi2 + k/phi1` (Euler with slip and backsweep; disc friction and recirculation) and the heat is in watts at
//! the map's reference state. All of it is found together by robust least squares of relative residuals. Limits of the
//! method (docs/reference/maps.md): work that grows at low speed for other reasons is taken for heat, and heat that fast lines lose to their
//! housing is not seen. Both are in the standard errors, by round numbers: half the heat, and one point of efficiency.

mod apply;
mod error;
mod estimate;
mod work;

pub use apply::{CorrectedLine, HeatCorrection, correct_for_heat};
pub use error::HeatCorrectionError;
