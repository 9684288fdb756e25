//! Readings of one step and their preparation for identification: cleaning, commands, window, and end state.

pub(crate) mod end_state;
pub(crate) mod humidity;
pub(crate) mod samples;
