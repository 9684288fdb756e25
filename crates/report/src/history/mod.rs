//! Comparison of many runs as tables and trends: nightly campaigns and studies.

pub(crate) mod fleet_text;
pub(crate) mod history_picture;
pub(crate) mod history_text;
pub(crate) mod night_text;
