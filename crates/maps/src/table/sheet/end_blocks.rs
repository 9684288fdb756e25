//! Blocks of a table that are no speed lines: the surge line below its title, and the line of choke.

use crate::table::column::Column;
use crate::table::description::DescribedColumns;
use crate::table::quantity::{Quantity, end_in, end_of_title, is_end_title, names_margin};
use crate::table::sheet::grid::{Grid, GridRow};
use crate::table::sheet::headings::Headings;
use crate::table::sheet::layout::{self, Group, Layout, columns};
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
    has_heading: bool,
    /// Whether it may be the surge line: that is its title, and its heading is known.
    is_read: bool,
    /// The columns of the surge line: those of its own heading, else those of the table.
    columns: Vec<Column>,
}

pub(crate) struct EndBlocks(Vec<EndBlock>);

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum RowUse<'a> {
    Line,
    /// A point in these columns.
    SurgeLine(&'a [Column]),
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
                    let is_known = match is_heading {
                        true => block.set_heading(grid, described, (index, row)),
                        // Those of its heading are in its columns.
                        false => {
                            block.has_heading || repeats_units(row) || !is_units_row_of_names(&row.cells)
                        }
                    };
                    block.is_read &= is_known;
                }
                // `Surge 0.04 1.3` in place of the speed.
                (None, None) if numbers >= 2 && row.cells.first().is_some_and(|c| end_in(c).is_some()) => {
                    blocks.push(EndBlock { count: 1, ..EndBlock::titled(row, index).until(index + 1) });
                }
                (None, None) => {}
                (_, title) => {
                    blocks.extend(open.take().map(|block| block.until(index)));
                    open = title.map(|end| EndBlock {
                        is_read: end == LineEnd::Surge
                            && layout.groups.len() == 1
                            && !names_margin(&row.text()),
                        ..EndBlock::titled(row, index)
                    });
                }
            }
        }
        blocks.extend(open.map(|block| block.until(grid.rows.len())));
        let titles: Vec<String> = blocks.iter().map(|block| block.title.clone()).collect();
        blocks.retain(|block| block.count > 0);
        for block in &mut blocks {
            if !block.has_heading {
                block.columns = block.columns_of_table(grid, layout);
            }
            block.is_read &= block.has_points(grid);
        }
        // A word that is repeated, or a comment, may name the end of the line above it.
        let is_mark = |block: &EndBlock| {
            let is_repeated = titles.iter().filter(|title| **title == block.title).count() > 1;
            (is_repeated || block.is_comment) && block.repeats_speeds(grid)
        };
        blocks.retain(|block| block.is_read || !is_mark(block));
        EndBlocks(blocks)
    }

    /// What a row is for.
    pub(crate) fn use_of(&self, index: usize) -> RowUse<'_> {
        match self.0.iter().find(|block| block.rows.contains(&index)) {
            None => RowUse::Line,
            Some(block) if block.is_read && index > block.rows.start => RowUse::SurgeLine(&block.columns),
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

impl EndBlock {
    fn titled(row: &GridRow, index: usize) -> EndBlock {
        let title = row.text().split_whitespace().collect::<Vec<_>>().join(" ");
        let is_comment = row.is_comment;
        EndBlock {
            title,
            rows: index..index,
            count: 0,
            is_comment,
            has_heading: false,
            is_read: false,
            columns: Vec::new(),
        }
    }

    /// Takes the columns of a heading, with the units below it; whether they are all known.
    fn set_heading(
        &mut self,
        grid: &Grid,
        described: &DescribedColumns,
        (index, row): (usize, &GridRow),
    ) -> bool {
        // Below the names there may be a row of units.
        if self.has_heading {
            return true;
        }
        let found = columns(described, &Headings::of(grid, index, row).cells);
        self.has_heading = found.is_ok();
        self.columns = found.unwrap_or_default();
        self.has_heading
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

    fn repeats_speeds(&self, grid: &Grid) -> bool {
        let is_speed = |column: &&Column| matches!(column.quantity, Quantity::Speed | Quantity::ReducedSpeed);
        let column = self.columns.iter().find(is_speed);
        let mut speeds: Vec<f64> = column
            .map(|column| self.numbers(grid, column))
            .unwrap_or_default()
            .into_iter()
            .flatten()
            .collect();
        speeds.sort_by(f64::total_cmp);
        speeds.windows(2).any(|pair| pair[0] == pair[1])
    }

    /// The columns of the table; without that of the speed if the rows are shorter by one cell.
    fn columns_of_table(&self, grid: &Grid, layout: &Layout) -> Vec<Column> {
        let table = layout.groups.first().map_or(&[][..], |group| group.columns.as_slice());
        let rows = grid.rows.get(self.rows.clone()).unwrap_or_default().iter().filter(|row| !row.is_comment);
        let width = rows.map(|row| row.cells.iter().filter(|cell| grid.number(cell).is_some()).count()).max();
        let place = |quantity: Quantity| table.iter().find(|column| column.quantity == quantity);
        match (place(Quantity::Speed), place(Quantity::Flow), place(Quantity::PressureRatio)) {
            (Some(speed), Some(flow), Some(ratio))
                if grid.is_blank_separated && width == Some(2) && speed.index == 0 =>
            {
                [flow, ratio].map(|column| column.clone().at(column.index - 1)).to_vec()
            }
            _ => table.to_vec(),
        }
    }

    /// Whether every row is one point of the surge line: all columns but the efficiency, and each speed once.
    fn has_points(&self, grid: &Grid) -> bool {
        let needed = self.columns.iter().filter(|column| {
            column.quantity != Quantity::Efficiency
                && !column.quantity.is_optional()
                && column.quantity != Quantity::T2
        });
        let is_speed = |column: &Column| matches!(column.quantity, Quantity::Speed | Quantity::ReducedSpeed);
        let is_complete = |column: &Column| {
            let numbers = self.numbers(grid, column);
            // The whole line may be without speeds.
            numbers.iter().all(Option::is_some) || is_speed(column) && numbers.iter().all(Option::is_none)
        };
        let group = Group { columns: self.columns.clone(), ..Group::default() };
        group.is_complete() && needed.into_iter().all(is_complete) && !self.repeats_speeds(grid)
    }
}
