//! Campaign keys that define the steps of a run: grid of points, repeats, timing, zero, surge search, or a script.

pub(crate) mod grid;
pub(crate) mod lines;
pub(crate) mod opening;
pub(crate) mod repeats;
pub(crate) mod sequence;
pub(crate) mod surge_search;
pub(crate) mod timing;
pub(crate) mod zero;
