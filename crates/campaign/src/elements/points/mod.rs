//! Campaign keys that define the steps of a run: grid of points, repeats, timing, zero, surge search, or a script.

pub(crate) mod grid;
pub(crate) mod repeats;
pub(crate) mod timing;
