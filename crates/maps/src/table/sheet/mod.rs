//! Cells of a map table from text or workbook, its layout, and its points as written.

pub(crate) mod end_blocks;
pub(crate) mod grid;
pub(crate) mod headings;
pub(crate) mod layout;
pub(crate) mod points;
pub(crate) mod workbook;
