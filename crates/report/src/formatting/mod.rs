//! Numbers, durations, tables and sentences as text for terminals and Markdown, shared by all reports.

pub(crate) mod bar_text;
pub(crate) mod display;
pub(crate) mod duration;
pub mod markdown;
pub(crate) mod number;
pub(crate) mod paint;
pub(crate) mod table;
pub(crate) mod wrapped;
