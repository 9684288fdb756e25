//! The fitted map for its users: values and standard errors at any place, and a table with marks of extrapolation.

pub(crate) mod line_errors;
pub(crate) mod surface;
pub(crate) mod table;
