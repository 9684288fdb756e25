//! Blocks of a table that are no speed lines: the surge line below its title, and the line of choke.

use crate::table::column::Column;
use crate::table::description::DescribedColumns;
use crate::table::quantity::{Quantity, end_in, end_of_title, is_end_title};
use crate::table::sheet::grid::{Grid, GridRow};
use crate::table::sheet::layout::{self, Layout, columns};
use mapper_core::{ImportRemark, LineEnd};
use mapper_table::is_units_row_of_names;
use std::ops::Range;

/// Rows below the title of an end.
#[derive(Debug, Clone)]
struct EndBlock {
    title: String,
    rows: Range<usize>,
    count: usize,
    is_comment: bool,
    /// Whether its rows are points of the surge line in the columns of the table.
    is_read: bool,
}

pub(crate) struct EndBlocks(Vec<EndBlock>);

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum RowUse {
    Line,
    SurgeLine,
    /// None.
    Unused,
}

impl EndBlocks {
    pub(crate) fn of(grid: &Grid, described: &DescribedColumns, layout: &Layout) -> EndBlocks {
        let above = layout.first_row.checked_sub(1).and_then(|above| grid.rows.get(above));
        let repeats_units = |row: &GridRow| above.is_some_and(|above| above.cells.starts_with(&row.cells));
        let is_line_title = |row: &GridRow| {
            let group = layout.groups.first();
            group.is_some_and(|group| layout::speed_of_title(grid, described, row, group).is_some())
        };
        let mut blocks: Vec<EndBlock> = Vec::new();
        let mut open: Option<EndBlock> = None;
        for (index, row) in grid.rows.iter().enumerate() {
            let numbers = count_numbers(grid, row);
            let is_heading = layout::is_heading(described, row);
            let is_above = index < layout.first_row;
            let title = end_of_title(&row.text()).filter(|_| numbers == 0 && !is_heading);
            let title = title.filter(|_| !is_above || !row.is_comment && is_end_title(&row.text()));
            if is_above && open.is_none() && title.is_none() {
                continue;
            }
            match (&mut open, title) {
                (_, None) if row.is_comment => {}
                (Some(block), None) if numbers > 0 && !is_line_title(row) => block.count += 1,
                (Some(block), None) if numbers == 0 && block.count == 0 && index + 1 != layout.first_row => {
                    let is_as_above = match is_heading {
                        true => has_columns(described, layout, row),
                        false => repeats_units(row) || !is_units_row_of_names(&row.cells),
                    };
                    block.is_read &= is_as_above;
                }
                // `Surge 0.04 1.3` in place of the speed.
                (None, None) if numbers >= 2 && row.cells.first().is_some_and(|c| end_in(c).is_some()) => {
                    blocks.push(EndBlock { count: 1, ..EndBlock::titled(row, index).until(index + 1) });
                }
                (None, None) => {}
                (_, title) => {
                    blocks.extend(open.take().map(|block| block.until(index)));
                    open = title.map(|end| EndBlock {
                        is_read: end == LineEnd::Surge && layout.groups.len() == 1,
                        ..EndBlock::titled(row, index)
                    });
                }
            }
        }
        blocks.extend(open.map(|block| block.until(grid.rows.len())));
        let titles: Vec<String> = blocks.iter().map(|block| block.title.clone()).collect();
        blocks.retain(|block| block.count > 0);
        for block in &mut blocks {
            block.is_read &= block.has_points(grid, layout);
        }
        // A word that is repeated, or a comment, may name the end of the line above it.
        let is_mark = |block: &EndBlock| {
            let is_repeated = titles.iter().filter(|title| **title == block.title).count() > 1;
            (is_repeated || block.is_comment) && block.repeats_speeds(grid, layout)
        };
        blocks.retain(|block| block.is_read || !is_mark(block));
        EndBlocks(blocks)
    }

    /// What a row is for.
    pub(crate) fn use_of(&self, index: usize) -> RowUse {
        match self.0.iter().find(|block| block.rows.contains(&index)) {
            None => RowUse::Line,
            Some(block) if block.is_read && index > block.rows.start => RowUse::SurgeLine,
            Some(_) => RowUse::Unused,
        }
    }

    pub(crate) fn remarks(&self) -> impl Iterator<Item = ImportRemark> + '_ {
        self.0.iter().map(|block| match block.is_read {
            true => ImportRemark::SurgeLine { points: block.count },
            false => {
                ImportRemark::UnusedBlock { title: block.title.chars().take(60).collect(), rows: block.count }
            }
        })
    }
}

fn count_numbers(grid: &Grid, row: &GridRow) -> usize {
    row.cells.iter().filter(|cell| grid.number(cell).is_some()).count()
}

/// Whether a heading within a block has the table's columns in their places.
fn has_columns(described: &DescribedColumns, layout: &Layout, row: &GridRow) -> bool {
    let known: Vec<&Column> = layout.groups.iter().flat_map(|group| &group.columns).collect();
    columns(described, &row.cells).is_ok_and(|own| {
        own.iter().all(|column| {
            known.iter().any(|known| {
                known.index == column.index
                    && known.quantity == column.quantity
                    && (!column.has_unit() || known.unit == column.unit)
            })
        })
    })
}

impl EndBlock {
    fn titled(row: &GridRow, index: usize) -> EndBlock {
        let title = row.text().split_whitespace().collect::<Vec<_>>().join(" ");
        EndBlock { title, rows: index..index, count: 0, is_comment: row.is_comment, is_read: false }
    }

    fn until(mut self, end: usize) -> EndBlock {
        self.rows.end = end;
        self
    }

    fn numbers(&self, grid: &Grid, column: &Column) -> Vec<Option<f64>> {
        let rows = grid.rows.get(self.rows.clone()).unwrap_or_default();
        let number = |row: &GridRow| row.cells.get(column.index).and_then(|cell| grid.number(cell));
        let has_number = |row: &&GridRow| !row.is_comment && count_numbers(grid, row) > 0;
        rows.iter().filter(has_number).map(number).collect()
    }

    fn speeds(&self, grid: &Grid, layout: &Layout) -> Vec<Option<f64>> {
        let group = layout.groups.first();
        let column = group.and_then(|group| group.columns.get(group.speed_column()?));
        column.map(|column| self.numbers(grid, column)).unwrap_or_default()
    }

    fn repeats_speeds(&self, grid: &Grid, layout: &Layout) -> bool {
        let mut speeds: Vec<f64> = self.speeds(grid, layout).into_iter().flatten().collect();
        speeds.sort_by(f64::total_cmp);
        speeds.windows(2).any(|pair| pair[0] == pair[1])
    }

    /// Whether every row is one point of the surge line: its own speed, and all columns but the efficiency.
    fn has_points(&self, grid: &Grid, layout: &Layout) -> bool {
        let needed = layout.groups.iter().flat_map(|group| &group.columns).filter(|column| {
            column.quantity != Quantity::Efficiency
                && !column.quantity.is_optional()
                && column.quantity != Quantity::T2
        });
        let is_complete = |column: &Column| self.numbers(grid, column).iter().all(Option::is_some);
        let mut needed = needed.peekable();
        needed.peek().is_some()
            && needed.all(is_complete)
            && !self.speeds(grid, layout).is_empty()
            && !self.repeats_speeds(grid, layout)
    }
}
