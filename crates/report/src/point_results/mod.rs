//! Identified points for test engineers: tables by speed line, warnings, uncertainty budgets, and agreement of methods.

pub(crate) mod point_tables;
pub(crate) mod point_warnings;
pub(crate) mod points;
pub(crate) mod summary;
pub(crate) mod warning_text;
