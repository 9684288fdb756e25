//! Makes a [`CompressorMap`](mapper_core::CompressorMap) from identified points, fits it, compares maps, and reads tables of map points.
//!
//! [`assemble`] moves every point to the speed of its line by similarity and records the shift. Points that could not be identified
//! stay without an efficiency: their flow and pressure ratio were measured. [`fit_map`] fits one smooth surface to all lines, with its
//! standard error everywhere and marks of extrapolation.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod assemble;
mod compare;
mod efficiency_definition;
mod line_ends;
mod map_fit;
mod repeats;
pub mod table;
mod turbine;

pub use assemble::{AssembleError, assemble};
pub use compare::{MapComparison, PlaceComparison, SpeedLineComparison, compare};
pub use efficiency_definition::convert_efficiency;
pub use line_ends::{DetectedEnd, LineEnds, mark_line_ends};
pub use map_fit::{MapFit, MapFitError, MapFitOptions, NearestPlace, fit_map, leave_out};
pub use repeats::{RepeatedJump, repeated_jumps};
pub use turbine::turbine_compare::{TurbineComparison, TurbinePointComparison, compare_turbines};
pub use turbine::turbine_fit::{ReducedTurbinePoint, reduce_turbine};
pub use turbine::turbine_fit::{TurbineFit, TurbineFitError, fit_turbine};
