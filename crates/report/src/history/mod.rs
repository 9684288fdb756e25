//! Comparison of many runs as tables and trends: nightly campaigns, a production of machines, and studies.

pub(crate) mod fleet_text;
pub(crate) mod history_picture;
pub(crate) mod history_text;
pub(crate) mod night_text;
pub(crate) mod production_text;
