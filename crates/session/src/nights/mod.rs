//! Nightly campaigns on the simulated rig: their runs, history entries, and the report that compares nights.

pub(crate) mod nightly;
