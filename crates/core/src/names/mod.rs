//! The meaning of column names, for the readers of logs and maps.

pub(crate) mod column_name;
pub(crate) mod measured;
pub(crate) mod missing;
mod name_parts;
mod tag;
pub(crate) mod words;
