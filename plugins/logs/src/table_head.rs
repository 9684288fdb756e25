//! Names, units and the first row of data of a table, found from its first rows.

use crate::instant::parse_instant;
use crate::number::{is_missing, parse_number};
use crate::separator::typical_length;
use mapper_logs::{DateOrder, LogOptions, header_unit, split_unit};
use std::collections::BTreeMap;

/// Maximum number of columns in a table.
pub(crate) const COLUMN_LIMIT: usize = 10_000;

/// The head of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct TableHead {
    pub(crate) columns: Vec<HeadColumn>,
    /// Index of the first row of data.
    pub(crate) data_row: usize,
    pub(crate) findings: Vec<String>,
}

/// One column of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct HeadColumn {
    pub(crate) name: String,
    pub(crate) header: String,
    pub(crate) unit: Option<String>,
    pub(crate) description: String,
}

/// Analyses the first rows of a table.
pub(crate) fn look(rows: &[Vec<String>], decimal: u8, options: &LogOptions) -> Result<TableHead, String> {
    let length = typical_length(rows);
    let given_row = options.data_row.map(|row| row - 1);
    let data_row = given_row
        .or_else(|| first_data_row(rows, length, decimal))
        .ok_or("no rows of numbers were found; say where they begin (`data_row`)")?;
    let header: Vec<usize> = header_rows(rows, data_row, length);
    let units_row = match options.units_row {
        Some(row) => row.checked_sub(1),
        None => header
            .iter()
            .copied()
            .filter(|row| Some(*row + 1) != options.names_row)
            .find(|row| is_units_row(&rows[*row])),
    };
    let others = || header.iter().copied().filter(|row| Some(*row) != units_row);
    let filled = |row: &usize| distinct(rows.get(*row));
    // The first of the rows with the most names: rows after it hold long names.
    let most = others().map(|row| filled(&row)).max().unwrap_or(0);
    let names_row = options
        .names_row
        .map(|row| row - 1)
        .or_else(|| others().find(|row| 10 * filled(row) >= 8 * most && most > 0));
    let width = rows.get(data_row..).unwrap_or_default().iter().map(Vec::len).max().unwrap_or(0).max(length);
    if width > COLUMN_LIMIT {
        return Err(format!("it has {width} columns; at most {COLUMN_LIMIT} are read"));
    }
    let cell = |row: Option<usize>, column: usize| {
        row.and_then(|row| rows.get(row)).and_then(|row| row.get(column)).map_or("", String::as_str)
    };
    let labels: Vec<usize> = others().filter(|row| Some(*row) != names_row).collect();
    let mut columns: Vec<HeadColumn> = Vec::new();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut repeated = 0;
    for column in 0..width {
        let header = cell(names_row, column).split_whitespace().collect::<Vec<_>>().join(" ");
        let own_unit = cell(units_row, column).trim_matches(['[', ']', '(', ')', ' ']);
        let (mut name, mut unit) = split_unit(&header);
        if units_row.is_some() {
            // `T2 (upper)` is a name if the units have their own row.
            (name, unit) =
                if own_unit.is_empty() && unit.is_some() { (name, unit) } else { (header.clone(), None) };
            unit = unit.or(Some(own_unit.to_owned()).filter(|unit| !unit.is_empty()));
        }
        if name.is_empty() {
            name = format!("column {}", column + 1);
        }
        let count = seen.entry(name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            repeated += 1;
            name = format!("{name} ({count})");
        }
        let description: Vec<&str> =
            labels.iter().map(|row| label(rows, *row, column)).filter(|text| !text.is_empty()).collect();
        columns.push(HeadColumn { header, name, unit, description: description.join(", ") });
    }
    // Columns without a name and without a cell come from separators at the ends of lines.
    let empty = |column: usize| {
        rows.get(data_row..)
            .unwrap_or_default()
            .iter()
            .all(|row| row.get(column).is_none_or(String::is_empty))
    };
    while columns.last().is_some_and(|column| column.header.is_empty()) && empty(columns.len() - 1) {
        columns.pop();
    }
    let mut findings = Vec::new();
    let row_number = |row: Option<usize>| row.map_or("none".to_owned(), |row| (row + 1).to_string());
    let in_names = units_row.is_none() && columns.iter().any(|column| column.unit.is_some());
    let units = if in_names { "in the names".to_owned() } else { row_number(units_row) };
    findings.push(format!(
        "header: names in row {}, units {}{}, data from row {} (names_row, units_row, data_row)",
        row_number(names_row),
        if units_row.is_some() { "in row " } else { "" },
        units,
        data_row + 1
    ));
    let before = header.first().copied().unwrap_or(data_row);
    if before > 0 {
        findings.push(format!("{before} rows before the header are passed over"));
    }
    if repeated > 0 {
        findings.push(format!("{repeated} names stand twice; the later ones are numbered: `name (2)`"));
    }
    Ok(TableHead { columns, data_row, findings })
}

/// Cells of a row of labels; a row of groups names only the first column of each.
fn label(rows: &[Vec<String>], row: usize, column: usize) -> &str {
    let Some(cells) = rows.get(row) else { return "" };
    let sparse = 2 * cells.iter().filter(|cell| !cell.is_empty()).count() < cells.len();
    let own = cells.get(column).map_or("", String::as_str);
    if !own.is_empty() || !sparse {
        return own;
    }
    cells.get(..column).unwrap_or_default().iter().rfind(|cell| !cell.is_empty()).map_or("", String::as_str)
}

fn distinct(row: Option<&Vec<String>>) -> usize {
    let mut cells: Vec<&String> = row.into_iter().flatten().filter(|cell| !cell.is_empty()).collect();
    cells.sort();
    cells.dedup();
    cells.len()
}

fn is_units_row(row: &[String]) -> bool {
    let filled: Vec<&String> = row.iter().filter(|cell| !cell.is_empty()).collect();
    let units = filled
        .iter()
        .filter(|cell| header_unit(cell).is_some() || header_unit(cell.trim_matches(['(', ')'])).is_some());
    let units = units.count();
    units > 0 && 2 * units >= filled.len()
}

fn header_rows(rows: &[Vec<String>], data_row: usize, length: usize) -> Vec<usize> {
    let like_a_header = |row: &usize| {
        let cells = &rows[*row];
        let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
        // A row of the preamble has a name and a value.
        cells.len() + 2 >= length && (filled > 2 || filled + 1 >= length)
    };
    let mut header: Vec<usize> =
        (0..data_row.min(rows.len())).rev().take_while(like_a_header).take(6).collect();
    header.reverse();
    header
}

fn first_data_row(rows: &[Vec<String>], length: usize, decimal: u8) -> Option<usize> {
    let data: Vec<bool> = rows.iter().map(|row| is_data(row, length, decimal)).collect();
    (0..rows.len()).find(|row| {
        let following = data.get(*row..(*row + 10).min(data.len())).unwrap_or_default();
        data[*row] && 10 * following.iter().filter(|is| **is).count() >= 8 * following.len()
    })
}

fn is_data(row: &[String], length: usize, decimal: u8) -> bool {
    let filled = row.iter().filter(|cell| !is_missing(cell.as_bytes()));
    let (mut values, mut words) = (0, 0);
    for cell in filled {
        let value = parse_number(cell.as_bytes(), decimal).is_some()
            || parse_instant(cell, DateOrder::DayFirst).is_some()
            || parse_instant(cell, DateOrder::MonthFirst).is_some();
        *(if value { &mut values } else { &mut words }) += 1;
    }
    row.len() + 2 >= length && values > 0 && values >= words
}
