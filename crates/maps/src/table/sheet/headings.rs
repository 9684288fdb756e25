//! A row of headings, with merged cells above it and units below it.

use crate::table::columns::column::parts;
use crate::table::sheet::grid::{Grid, GridRow};
use crate::table::units_row::merge_units_row;
use mapper_core::ImportRemark;
use mapper_table::{ColumnName, Word, bare_unit, is_dimensionless, is_unit, is_units_row};

/// A row of headings.
pub(crate) struct Headings {
    /// The cells, with the machine of a merged cell above them.
    pub(crate) names: Vec<String>,
    /// The names with the units of the row below.
    pub(crate) cells: Vec<String>,
    /// Index of the first row below.
    pub(crate) first_row: usize,
}

impl Headings {
    pub(crate) fn of(grid: &Grid, index: usize, row: &GridRow) -> Headings {
        let above = index.checked_sub(1).and_then(|above| grid.rows.get(above));
        let names = above
            .filter(|above| !grid.is_blank_separated && is_row_of_groups(above, row))
            .map_or_else(|| row.cells.clone(), |above| with_groups(&above.cells, &row.cells));
        // Symbols or a comment may be between names and units; in some tables the units come first.
        let is_number = |cell: &String| grid.number(cell).is_some() && !is_unit(cell);
        let near = grid.rows.iter().enumerate().skip(index + 1).take(MAX_ROWS_TO_UNITS);
        let mut near = near.take_while(|(_, row)| !row.cells.iter().any(is_number));
        let below = near.find_map(|(at, row)| Some((at + 1, merge_units_row(&names, &row.cells)?)));
        // Above there may be any text: units are most of its cells.
        let is_units = |row: &&GridRow| {
            let known = row.cells.iter().filter(|cell| is_unit(bare_unit(cell)) && !is_dimensionless(cell));
            known.count() > 1 && is_units_row(&row.cells)
        };
        let above = || Some((index + 1, merge_units_row(&names, &above.filter(is_units)?.cells)?));
        let (first_row, cells) = below.or_else(above).unwrap_or_else(|| (index + 1, names.clone()));
        Headings { cells, names, first_row }
    }

    /// A remark that names the columns outside `used`, if there are any.
    pub(crate) fn unused(&self, used: &[usize]) -> Option<ImportRemark> {
        let unused =
            self.cells.iter().enumerate().filter(|(index, cell)| !cell.is_empty() && !used.contains(index));
        let headings: Vec<String> =
            unused.map(|(_, cell)| cell.chars().take(60).collect()).take(MAX_NAMED).collect();
        (!headings.is_empty()).then_some(ImportRemark::UnusedColumns { headings })
    }
}

/// Rows from names to units. Bound: symbols and a description may be between them.
const MAX_ROWS_TO_UNITS: usize = 3;
/// Maximum number of unused columns that a remark names. Bound: a longer list is not read.
const MAX_NAMED: usize = 20;

/// Whether merged cells above a row name the machines of its columns. A title stands alone in the first column.
fn is_row_of_groups(above: &GridRow, row: &GridRow) -> bool {
    let filled = || above.cells.iter().enumerate().filter(|(_, cell)| !cell.is_empty());
    let has_gap = |(index, cell): (usize, &String)| {
        !cell.is_empty() && above.cells.get(index).is_none_or(String::is_empty)
    };
    !above.is_comment
        && filled().any(|(index, _)| index > 0)
        && filled().all(|(_, cell)| !cell.contains(|c: char| c.is_ascii_digit()))
        && filled().any(|(_, cell)| names_machine(cell))
        && row.cells.iter().enumerate().any(has_gap)
}

fn names_machine(text: &str) -> bool {
    let name = ColumnName::read(text);
    [Word::Compressor, Word::Turbine, Word::Shaft, Word::Oil].iter().any(|word| name.has(*word))
}

/// The names with the machine above them, which a merged cell has only in its first column: `p in [kPa]` below `Turbine` becomes
/// `p in Turbine [kPa]`.
fn with_groups(above: &[String], cells: &[String]) -> Vec<String> {
    let mut group = "";
    let named = cells.iter().enumerate().map(|(index, cell)| {
        group = above.get(index).filter(|cell| !cell.is_empty()).map_or(group, String::as_str);
        if cell.is_empty() || !names_machine(group) || names_machine(cell) {
            return cell.clone();
        }
        match parts(cell) {
            (name, Some(unit)) if !name.is_empty() => format!("{name} {group} [{unit}]"),
            _ => format!("{cell} {group}"),
        }
    });
    named.collect()
}
