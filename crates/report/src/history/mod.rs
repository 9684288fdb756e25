//! Comparison of many runs as tables and trends: nightly campaigns and studies.

pub(crate) mod history_picture;
pub(crate) mod nights;
pub(crate) mod studies;
