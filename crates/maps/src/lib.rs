//! From identified points to a compressor map: points in corrected quantities, grouped into speed lines.
//!
//! [`assemble`] brings every point but repeats to the speed of its line, by similarity, and keeps the shift on record.
//! Points that could not be identified stay in the map without an efficiency; their flow and pressure ratio were
//! measured all the same. [`fit_map`] lays a smooth surface through all lines together, says how sure it is at every
//! place and where it is extrapolated.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod assemble;
mod compare;
mod efficiency_definition;
mod error;
mod grouping;
mod heat_correction;
mod line_ends;
mod map_fit;
mod repeated_jumps;
mod repeats;
pub mod table;
mod turbine;

pub use assemble::assemble;
pub use compare::{ComparedLine, ComparedPlace, MapComparison, compare};
pub use efficiency_definition::convert_efficiency;
pub use error::AssembleError;
pub use grouping::Grouping;
pub use heat_correction::{CorrectedLine, HeatCorrection, HeatCorrectionError, correct_for_heat};
pub use line_ends::{FoundEnd, LineEnds, mark_line_ends};
pub use map_fit::{MapFit, MapFitError, MapFitOptions, NearestPlace, fit_map, leave_out};
pub use repeated_jumps::{RepeatedJump, repeated_jumps};
pub use repeats::points_for_map;
pub use turbine::turbine_compare::{ComparedTurbinePoint, TurbineComparison, compare_turbines};
pub use turbine::turbine_fit::{TurbineFit, TurbineFitError, fit_turbine};
pub use turbine::turbine_points::{ReducedTurbinePoint, reduce_turbine};
