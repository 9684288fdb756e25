//! The surge line, sought by what comes before it: pressures and flow vary ever more as the valve closes.
//!
//! A [`SurgeReading`] is what was read at one opening. [`SurgeEstimate`] carries the growth of the variation on to the flow at which
//! it would have no bound, [`next_move`] says how far the valve may be closed by it, and [`surge_marks`] finds the marks of a
//! whole recording by the same rules. docs/maps.md describes them.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod estimate;
mod growth_law;
mod mark;
mod next_move;
mod smooth;
mod surge_reading;
mod variation;

pub use estimate::SurgeEstimate;
pub use mark::{SurgeErrors, SurgeMarks, surge_marks};
pub use next_move::{Move, Why, expected_looks, next_move};
pub use surge_reading::{LOOKED_AT, SurgeReading};
pub use variation::Variation;
