//! Channel maps that assign topics and fields of other programs to the rig's channels, with units and checks.

pub(crate) mod channel_map;
pub(crate) mod channel_map_yaml;
pub(crate) mod plausibility;
