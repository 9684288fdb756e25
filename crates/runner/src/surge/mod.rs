//! Estimates the surge line from its precursors: the variation of pressures and flow grows as the valve closes.
//!
//! A [`SurgeReading`] holds the readings at one opening. [`SurgeEstimate`] extrapolates the growth of the variation to the flow at
//! which it would diverge. [`choose_next_move`] limits the next closing of the valve, and [`find_surge_marks`] applies the same rules to a whole
//! recording. docs/reference/maps.md describes them.

pub(crate) mod estimate;
pub(crate) mod mark;

pub use estimate::{
    LineEnd, Move, PRECURSOR_CHANNELS, SurgeEstimate, SurgeReading, Variation, choose_next_move,
    expected_readings,
};
pub use mark::{SurgeErrors, SurgeMarks, find_surge_marks};
