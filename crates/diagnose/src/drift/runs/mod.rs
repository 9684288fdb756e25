//! Input of the drift diagnosis: usable runs on one time axis, their segments, and repeated jumps.

pub(crate) mod repeats;
pub(crate) mod request;
pub(crate) mod time_axis;
pub(crate) mod usable;
