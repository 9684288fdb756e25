//! Tables for a terminal, numbers to the right, units in the head.

use comfy_table::{CellAlignment, Table, presets};

/// A table with these column heads; all columns but the first are numbers.
pub fn with_heads(heads: &[String]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(heads);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
