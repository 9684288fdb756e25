//! Checks of a campaign beyond its schema: consistency of values, reachable points, and warnings about unusual values.

pub(crate) mod calibration;
pub(crate) mod concern;
pub(crate) mod consistency;
pub(crate) mod prospects;
pub(crate) mod reachable_points;
