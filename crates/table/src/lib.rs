//! Reads tables: logs, maps and steady points are cells in rows, below headings with names and units.
//!
//! From bytes to quantities:
//! 1. [`TextEncoding::guess`] finds the encoding of a text, [`detect_text`] its separator and decimal sign; [`TextRows`] yields its rows
//!    one after the other, [`SheetRows`] those of a [`Book`] of Excel.
//! 2. [`parse_number`], [`number_with_unit`] and [`parse_instant`] read cells; [`is_missing_mark`] knows the marks of missing values.
//! 3. [`ColumnName`] reads quantity and place from the name of a column, from a table of words in twelve languages; [`header_unit`] and
//!    [`split_unit`] find its unit.
//!
//! Files are hostile until read: sizes, lengths and nesting have limits, and no text panics.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod column_name;
mod instant;
mod mat5;
mod name_parts;
mod number;
mod text;
mod units;
mod workbook;
mod xls;
mod xlsx_limits;

pub use column_name::{Clarity, ColumnName, Place, channel_at};
pub use instant::{DateOrder, Instant, NS_PER_DAY, guess_order, minutes_and_seconds, parse_instant};
pub use mat5::{MatArray, MatFile, is_mat5, read_mat5};
pub use name_parts::{Measured, Word};
pub use number::{
    NO_READING, is_missing, is_missing_mark, number_in, number_with_unit, parse_number, read_number,
};
pub use text::{
    DecodingReader, Dialect, SEPARATORS, TextEncoding, TextRows, decimal_sign, detect_text, typical_length,
};
pub use units::{
    HeaderUnit, Reference, bare_unit, difference, header_unit, is_dimensionless, is_reduced_unit, is_unit,
    is_units_row, is_units_row_of_names, joined_units, kind_of, parse_quantity, remedy, split_unit, unit,
    volume_flow_m3_s, with_unknown_units,
};
pub use workbook::{Book, SheetRows, Value, decimal_sign_of_cells, is_workbook};
pub use xls::{Cell, Sheet, XLS_MAGIC, read_xls};
pub use xlsx_limits::{XlsxLimits, check_xlsx};
