//! Notations of logs from other programs: encodings, separators, numbers, dates, and typed cells.

pub(crate) mod encoding;
pub(crate) mod instant;
pub(crate) mod number;
pub(crate) mod separator;
pub(crate) mod table_row;
pub(crate) mod typed_cell;
