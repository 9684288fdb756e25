//! Reads the sheets of Excel 97 to 2003 workbooks (`.xls`, [MS-XLS]) within limits, for logs and maps: [`read_xls`] returns each [`Sheet`].
//!
//! `calamine` reads them too, but fills the rectangle around all cells of a sheet (0.4 GB for two cells in opposite corners), follows
//! endless chains of sectors and panics on short records. Here memory is at most six times the size of the file, since a cell has at least six
//! bytes in the file and 32 here. Later workbooks (`.xlsx`) are read by `calamine` after [`check_xlsx`].

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod read;
mod records;
mod strings;
mod xlsx_limits;

pub use read::{Cell, Sheet, read_xls};
pub use xlsx_limits::{XlsxLimits, check_xlsx};

/// The first bytes of a compound file, which holds a workbook of Excel 97 to 2003.
pub const MAGIC: [u8; 8] = *b"\xD0\xCF\x11\xE0\xA1\xB1\x1A\xE1";
