//! Identified points for test engineers: tables by speed line, warnings, uncertainty budgets, and agreement of methods.

pub(crate) mod budget_table;
pub(crate) mod disagreement;
pub(crate) mod end_readings;
pub(crate) mod lines_of_points;
pub(crate) mod point_table;
pub(crate) mod point_warnings;
pub(crate) mod points;
pub(crate) mod result_remark_text;
pub(crate) mod shared_errors;
pub(crate) mod warning_text;
