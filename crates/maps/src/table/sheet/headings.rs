//! A row of headings, with merged cells above it and units below it; speeds in titles and headings: `N = 60000 rpm`, `PR@60000`,
//! `60 krpm | flow [kg/s]`.

use crate::table::column::{merge_units_row, parts};
use crate::table::sheet::grid::{Grid, GridRow};
use mapper_core::ImportRemark;
use mapper_core::unit_factors::RPM_PER_KRPM;
use mapper_table::{
    ColumnName, Word, bare_unit, header_unit, is_dimensionless, is_missing_mark, is_unit, is_units_row,
    with_unknown_units,
};
use mapper_yaml::units::{Kind, Unit};
use std::ops::RangeInclusive;

pub(crate) struct Headings {
    /// The cells, with the machine of a merged cell above them.
    pub(crate) names: Vec<String>,
    /// The names with the units of the row below.
    pub(crate) cells: Vec<String>,
    pub(crate) first_row: usize,
    /// A row of words below the names that is not understood, if the units are not known from elsewhere.
    unknown_row: Option<String>,
}

impl Headings {
    pub(crate) fn of(grid: &Grid, index: usize, row: &GridRow) -> Headings {
        let above = index.checked_sub(1).and_then(|above| grid.rows.get(above));
        let names = merged_above(grid, index, row)
            .map_or_else(|| row.cells.clone(), |groups| with_groups(&groups, &row.cells));
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
        let found = below.or_else(above);
        let unknown_row = grid.rows.get(index + 1).filter(|row| found.is_none() && is_unknown(row));
        let unknown_row = unknown_row.map(GridRow::text);
        let (first_row, cells) = found.unwrap_or_else(|| (index + 1, with_unknown_units(&names)));
        Headings { cells, names, first_row, unknown_row }
    }

    /// Remarks about what is not used.
    pub(crate) fn remarks(&self, used: &[usize]) -> impl Iterator<Item = ImportRemark> {
        let unknown = self.unknown_row.iter().map(|text| text.chars().take(60).collect::<String>());
        let unknown = unknown.map(|title| ImportRemark::UnusedBlock { title, rows: 1 });
        unknown.chain(self.unused(used)).collect::<Vec<_>>().into_iter()
    }

    fn unused(&self, used: &[usize]) -> Option<ImportRemark> {
        let unused =
            self.cells.iter().enumerate().filter(|(index, cell)| !cell.is_empty() && !used.contains(index));
        let headings: Vec<String> =
            unused.map(|(_, cell)| cell.chars().take(60).collect()).take(MAX_NAMED).collect();
        (!headings.is_empty()).then_some(ImportRemark::UnusedColumns { headings })
    }
}

/// Whether a row between names and numbers has words of no known kind, which may be units.
fn is_unknown(row: &GridRow) -> bool {
    let filled = || row.cells.iter().filter(|cell| !is_missing_mark(cell));
    let is_other = |cell: &String| {
        !cell.contains(|c: char| c.is_ascii_digit()) && ColumnName::read(cell).measured().is_none()
    };
    !row.is_comment && filled().count() > 1 && filled().all(is_other)
}

/// Rows from names to units. Bound: symbols and a description may be between them.
const MAX_ROWS_TO_UNITS: usize = 3;
/// Maximum number of unused columns that a remark names. Bound: a longer list is not read.
const MAX_NAMED: usize = 20;

/// The text of merged cells above each column: the machine, or the machine and the place from two rows (`Compressor` above `Inlet`).
fn merged_above(grid: &Grid, index: usize, row: &GridRow) -> Option<Vec<String>> {
    let at = |above: usize| index.checked_sub(above).and_then(|at| grid.rows.get(at));
    let above = at(1).filter(|_| !grid.is_blank_separated).filter(|above| is_row_of_groups(above, row))?;
    let top =
        at(2).filter(|top| is_row_of_groups(top, row) && top.cells.iter().any(|cell| names_machine(cell)));
    let (mut group, mut place) = ("", "");
    let text = (0..row.cells.len()).map(|column| {
        if let Some(cell) = top.and_then(|top| top.cells.get(column)).filter(|cell| !cell.is_empty()) {
            (group, place) = (cell.as_str(), "");
        }
        if let Some(cell) = above.cells.get(column).filter(|cell| !cell.is_empty()) {
            place = cell.as_str();
        }
        format!("{group} {place}").trim().to_owned()
    });
    Some(text.collect())
}

/// Whether merged cells above a row name machines or places of its columns. A title stands alone in the first column.
fn is_row_of_groups(above: &GridRow, row: &GridRow) -> bool {
    let filled = || above.cells.iter().enumerate().filter(|(_, cell)| !cell.is_empty());
    let has_gap = |(index, cell): (usize, &String)| {
        !cell.is_empty() && above.cells.get(index).is_none_or(String::is_empty)
    };
    !above.is_comment
        && filled().any(|(index, _)| index > 0)
        && filled().all(|(_, cell)| !cell.contains(|c: char| c.is_ascii_digit()))
        && (filled().any(|(_, cell)| names_machine(cell)) || filled().all(|(_, cell)| names_place(cell)))
        && row.cells.iter().enumerate().any(has_gap)
}

fn names_machine(text: &str) -> bool {
    let name = ColumnName::read(text);
    [Word::Compressor, Word::Turbine, Word::Shaft, Word::Oil].iter().any(|word| name.has(*word))
}

fn names_place(text: &str) -> bool {
    let name = ColumnName::read(text);
    [Word::In, Word::Out, Word::Before, Word::After].iter().any(|word| name.has(*word))
}

/// The names with the machine or place above them: `p in [kPa]` below `Turbine` becomes `p in Turbine [kPa]`.
fn with_groups(above: &[String], cells: &[String]) -> Vec<String> {
    let named = cells.iter().zip(above).map(|(cell, group)| {
        let is_group =
            names_machine(group) && !names_machine(cell) || names_place(group) && !names_place(cell);
        if cell.is_empty() || !is_group {
            return cell.clone();
        }
        match parts(cell) {
            (name, Some(unit)) if !name.is_empty() => format!("{name} {group} [{unit}]"),
            _ => format!("{cell} {group}"),
        }
    });
    named.collect()
}

/// Range of a number without a unit that is a speed, rpm. Bound: smaller numbers are diameters in mm, temperatures or pressures in mbar, larger
/// ones dates.
const BARE_RPM: RangeInclusive<f64> = 5e3..=1e6;

fn is_separator(c: char) -> bool {
    c.is_whitespace() || matches!(c, '=' | ':' | '[' | ']' | '(' | ')')
}

fn speed_unit(text: &str) -> Option<&'static Unit> {
    header_unit(text).filter(|found| found.kind == Kind::Speed).map(|found| found.unit)
}

/// The one number of a text with its unit of speed; rpm if it names none.
pub(crate) fn speed_in(grid: &Grid, text: &str) -> Option<f64> {
    let words = || text.split(is_separator).filter(|word| !word.is_empty());
    let mut speeds = words().filter_map(|word| {
        let digits = word.find(|c: char| c.is_alphabetic()).unwrap_or(word.len());
        grid.number(&word[..digits]).map(|value| (value, &word[digits..]))
    });
    let (value, unit) = speeds.next()?;
    if speeds.next().is_some() {
        return None;
    }
    let unit = speed_unit(unit).or_else(|| words().find_map(speed_unit));
    Some(unit.map_or(value, |unit| unit.to_inside(value))).filter(|rpm| *rpm > 0.0)
}

pub(crate) fn without_speed(grid: &Grid, heading: &str) -> Option<(String, f64)> {
    let is_number_char = |c: char| c.is_ascii_digit() || matches!(c, '.' | ',');
    let mut from = 0;
    while let Some(start) = heading[from..].find(|c: char| c.is_ascii_digit()).map(|at| from + at) {
        let length = heading[start..].find(|c: char| !is_number_char(c)).unwrap_or(heading.len() - start);
        from = start + length;
        let number = heading[start..from].trim_end_matches(['.', ',']);
        let after = heading[from..].trim_start_matches([' ', '_', '[', '(']);
        let end = after.find(|c: char| c.is_whitespace() || "|_:;)]".contains(c)).unwrap_or(after.len());
        let (unit, rest) = after.split_at(end);
        let is_bracket = heading[from..].trim_start().starts_with(['[', '(']);
        let Some(value) = grid.number(number) else { continue };
        let (speed_rpm, rest) = match speed_unit(unit) {
            Some(unit) => (unit.to_inside(value), rest),
            None if unit == "k" => (RPM_PER_KRPM * value, rest),
            // A number with another unit, for example of a pressure, is not a speed.
            None if !BARE_RPM.contains(&value) || header_unit(unit).is_some() && !is_bracket => continue,
            None => (value, &heading[from..]),
        };
        let mut before = &heading[..start];
        loop {
            let cut = before.trim_end_matches(|c: char| {
                is_separator(c) && !matches!(c, ']' | ')') || "@|_-,".contains(c)
            });
            let word = cut.rfind(|c: char| is_separator(c) || "@|_-".contains(c)).map_or(0, |at| at + 1);
            match cut.get(word..).map(str::to_lowercase).as_deref() {
                Some("n" | "nc" | "at" | "bei" | "speed" | "drehzahl" | "line") => before = &cut[..word],
                _ => {
                    before = cut;
                    break;
                }
            }
        }
        let rest = rest.trim_start_matches(|c: char| c.is_whitespace() || "|_:-)],".contains(c));
        return Some((format!("{before} {rest}").trim().to_owned(), speed_rpm)).filter(|_| speed_rpm > 0.0);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_may_hold_the_speed_of_its_line() {
        let grid = Grid::of_text("1,2,3\n").unwrap();
        for (heading, name, rpm) in [
            ("PR@60000", "PR", 6e4),
            ("eta @ 60 krpm [%]", "eta [%]", 6e4),
            ("60000 rpm | flow [kg/s]", "flow [kg/s]", 6e4),
            ("flow_60000 [kg/s]", "flow [kg/s]", 6e4),
            ("m (n=60000 1/min) [g/s]", "m [g/s]", 6e4),
            ("PR_120k", "PR", 12e4),
            ("60krpm", "", 6e4),
            ("60000", "", 6e4),
            ("N60000 PR", "PR", 6e4),
        ] {
            let (found, found_rpm) = without_speed(&grid, heading).unwrap_or_else(|| panic!("{heading}"));
            assert_eq!((found.as_str(), found_rpm), (name, rpm), "{heading}");
        }
        for heading in ["P2/P1", "flow at 101325 Pa", "T1 298.15 K", "eta 0.8", "p 98100Pa"] {
            assert_eq!(without_speed(&grid, heading), None, "{heading}");
        }
    }
}
