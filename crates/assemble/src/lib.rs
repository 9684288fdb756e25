//! From identified points to a compressor map: points in corrected quantities, grouped into speed lines.
//!
//! Nothing is fitted, smoothed or extrapolated here: every point but repeats goes into exactly one line as it was measured.
//! Points that could not be identified stay in the map without an efficiency; their flow and pressure ratio were
//! measured all the same.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod assemble;
mod error;
mod grouping;
mod repeats;

pub use assemble::assemble;
pub use error::AssembleError;
pub use grouping::Grouping;
pub use repeats::points_for_map;
