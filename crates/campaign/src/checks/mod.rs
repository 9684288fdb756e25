//! Checks of a campaign beyond its schema: consistency of values, reachable points, and warnings about unusual values.

pub(crate) mod map_misfit;
pub(crate) mod unusual_settings;
