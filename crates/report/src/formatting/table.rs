//! Tables for a terminal, numbers to the right, units in the head.

use crate::formatting::wrapped::wrapped;
use comfy_table::{CellAlignment, Table, presets};

/// Columns of a terminal.
const COLUMNS: usize = 80;
/// Spaces around a cell.
const PADDING: usize = 2;
/// Usual width of a number.
const NUMBER: usize = 6;
/// Width of a head that is broken into lines, if its words allow it.
const NARROW: usize = 8;

/// A table with these column heads; all columns but the first are numbers. If the heads together are wider than a terminal, they are
/// broken into lines.
pub fn with_heads(heads: &[String]) -> Table {
    let width: usize = heads.iter().map(|head| head.chars().count().max(NUMBER) + PADDING).sum();
    let is_wide = width > COLUMNS;
    let shown =
        |head: &String| if is_wide { wrapped(head, NARROW, 0).trim_end().to_owned() } else { head.clone() };
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(heads.iter().map(shown));
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
        if is_wide {
            column.set_padding((1, 0));
        }
    }
    table
}
