//! Smooth surfaces through turbine maps with intervals.

pub(crate) mod turbine_fit;
pub(crate) mod turbine_surface;
