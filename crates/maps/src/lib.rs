//! Makes a [`CompressorMap`](mapper_core::CompressorMap) from identified points, fits it, compares, scales and merges maps, and reads tables of map points.
//!
//! [`assemble`] moves every point to the speed of its line by similarity and records the shift. Points that could not be identified
//! stay without an efficiency: their flow and pressure ratio were measured. [`fit_map`] fits one smooth surface to all lines, with its
//! standard error everywhere and marks of extrapolation.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod assemble;
mod compare;
mod derived;
mod map_fit;
pub mod table;
mod turbine;

pub use assemble::{AssembleError, RepeatedJump, assemble, convert_efficiency, repeated_jumps};
pub use compare::{
    DetectedEnd, LineEnds, MapComparison, PlaceComparison, SpeedLineComparison, TurbineComparison,
    TurbinePointComparison, compare, compare_turbines, mark_line_ends,
};
pub use derived::{MapScale, MergedLine, MergedMap, ScaleError, merge, scaled};
pub use map_fit::{MapFit, MapFitError, MapFitOptions, NearestPlace, fit_map, leave_out};
pub use turbine::turbine_fit::{
    ReducedTurbinePoint, TurbineFit, TurbineFitError, fit_turbine, identified_turbine_map, reduce_turbine,
    turbine_points_by_line,
};
