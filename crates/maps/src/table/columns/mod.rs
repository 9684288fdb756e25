//! Quantities and units of the columns of a map table, from their headings or from the user's map description.

pub(crate) mod column;
pub(crate) mod described_columns;
pub(crate) mod quantity;
