//! Smooth surfaces through turbine maps with intervals, and the comparison of two turbine maps.

pub(crate) mod turbine_compare;
pub(crate) mod turbine_fit;
pub(crate) mod turbine_surface;
