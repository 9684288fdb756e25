//! Tables whose columns lie in rows, or in several tables.

use crate::tables::table_log::Table;
use crate::tables::table_row::{Cell, Cells, RowStream, Rows};
use mapper_recording::logs::{Layout, LogError, LogFinding, Row, RowSink};
use mapper_table::{header_unit, is_missing, read_number};
use std::collections::BTreeSet;

const MAX_NAMES: usize = 1000;

/// Minimum number of rows per name in the sample; with fewer the column does not contain names.
const MIN_ROWS_PER_NAME: usize = 3;

/// Minimum share of rows in which the name differs from the previous row's. The state of a stand is constant over many rows.
const MIN_CHANGE_SHARE: f64 = 0.5;

/// Maximum further numbers in a row, such as a quality, in addition to time, name and value.
const MAX_FURTHER_NUMBERS: usize = 2;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LongForm {
    clock: Vec<usize>,
    name: usize,
    value: usize,
    data_row: usize,
    /// Header of the table with a column for each quantity: the clock, then names with units.
    header: Vec<String>,
    names: Vec<String>,
}

impl LongForm {
    pub(crate) fn find(rows: &[Vec<String>], table: &Table, decimal: u8) -> Option<LongForm> {
        let data_row = table.data_row();
        let data = rows.get(data_row..)?;
        let header = rows.get(data_row.checked_sub(1)?)?;
        let clock = table.clock_columns();
        let column = |at: usize| {
            data.iter().filter_map(move |row| row.get(at)).filter(|cell| !is_missing(cell.as_bytes()))
        };
        let is_number = |at: usize| {
            let (numbers, all) = column(at).fold((0usize, 0usize), |(numbers, all), cell| {
                (numbers + usize::from(read_number(cell, decimal).is_some()), all + 1)
            });
            all > 0 && 10 * numbers >= 9 * all
        };
        let others: Vec<usize> = (0..header.len()).filter(|at| !clock.contains(at)).collect();
        let (numbers, words): (Vec<usize>, Vec<usize>) = others.into_iter().partition(|at| is_number(*at));
        let distinct = |at: usize| column(at).collect::<BTreeSet<_>>().len();
        let is_unit = |at: usize| column(at).all(|cell| header_unit(cell).is_some());
        let name = words.iter().copied().filter(|at| !is_unit(*at)).max_by_key(|at| distinct(*at))?;
        let value = numbers.iter().copied().max_by_key(|at| distinct(*at))?;
        let count = distinct(name);
        let names_of_rows: Vec<&String> = column(name).collect();
        let changes = names_of_rows.windows(2).filter(|pair| pair[0] != pair[1]).count() as f64;
        if changes < MIN_CHANGE_SHARE * names_of_rows.len() as f64
            || numbers.len() > 1 + MAX_FURTHER_NUMBERS
            || clock.is_empty()
            || !(2..=MAX_NAMES).contains(&count)
            || MIN_ROWS_PER_NAME * count > data.len()
        {
            return None;
        }
        let unit = words.iter().copied().find(|at| is_unit(*at) && column(*at).next().is_some());
        let mut names: Vec<String> = Vec::new();
        let mut wide_header: Vec<String> =
            vec![clock.iter().filter_map(|at| header.get(*at)).cloned().collect::<Vec<_>>().join(" ")];
        for row in data {
            let Some(name) = row.get(name).filter(|name| !name.is_empty() && !names.contains(name)) else {
                continue;
            };
            let unit = unit.and_then(|unit| row.get(unit)).filter(|unit| !unit.is_empty());
            wide_header.push(unit.map_or(name.clone(), |unit| format!("{name} [{unit}]")));
            names.push(name.clone());
        }
        Some(LongForm { clock, name, value, data_row, header: wide_header, names })
    }

    pub(crate) fn finding(&self, rows: &[Vec<String>]) -> LogFinding {
        let header = self.data_row.checked_sub(1).and_then(|row| rows.get(row));
        let cell = |at: usize| header.and_then(|row| row.get(at)).cloned().unwrap_or_default();
        LogFinding::LongForm { name: cell(self.name), value: cell(self.value), quantities: self.names.len() }
    }

    pub(crate) fn wide(&self, rows: &[Vec<String>]) -> Vec<Vec<String>> {
        let mut gathered = WideRow::new(self);
        let mut wide = vec![self.header.clone()];
        for row in rows.get(self.data_row..).unwrap_or_default() {
            wide.extend(gathered.take(self, row));
        }
        wide.extend(gathered.finish());
        wide
    }
}

struct WideRow {
    row: Vec<String>,
    filled: bool,
}

impl WideRow {
    fn new(form: &LongForm) -> Self {
        WideRow { row: vec![String::new(); form.names.len() + 1], filled: false }
    }

    /// Adds a row of the file; returns the finished row if a new one begins.
    fn take(&mut self, form: &LongForm, row: &[String]) -> Option<Vec<String>> {
        let cell = |at: usize| row.get(at).map_or("", String::as_str);
        let at = form.names.iter().position(|name| name == cell(form.name))? + 1;
        let time = form.clock.iter().map(|clock| cell(*clock)).collect::<Vec<_>>().join(" ");
        let is_new_row =
            self.row.first() != Some(&time) || self.row.get(at).is_some_and(|value| !value.is_empty());
        let done = if is_new_row { self.finish() } else { None };
        if let Some(place) = self.row.first_mut() {
            *place = time;
        }
        if let Some(place) = self.row.get_mut(at) {
            cell(form.value).clone_into(place);
        }
        self.filled = true;
        done
    }

    fn finish(&mut self) -> Option<Vec<String>> {
        let empty = vec![String::new(); self.row.len()];
        let row = std::mem::replace(&mut self.row, empty);
        std::mem::take(&mut self.filled).then_some(row)
    }
}

pub(crate) struct LongRows {
    stream: RowStream,
    form: LongForm,
    decimal: u8,
    gathered: WideRow,
    row: Vec<String>,
    /// Rows of the file to skip before its data; `None` before the header was returned.
    before: Option<usize>,
    ended: bool,
}

impl LongRows {
    pub(crate) fn new(stream: RowStream, form: LongForm, decimal: u8) -> Self {
        let gathered = WideRow::new(&form);
        LongRows { stream, gathered, row: Vec::new(), before: None, ended: false, form, decimal }
    }
}

impl Cells for LongRows {
    fn cell(&self, column: usize) -> Cell<'_> {
        self.row.get(column).map_or(Cell::Empty, |text| Cell::Text(text.as_bytes()))
    }

    fn decimal(&self) -> u8 {
        self.decimal
    }
}

impl Rows for LongRows {
    fn advance(&mut self) -> Result<bool, LogError> {
        let Some(before) = &mut self.before else {
            self.before = Some(self.form.data_row);
            self.row.clone_from(&self.form.header);
            return Ok(true);
        };
        while *before > 0 {
            *before -= 1;
            self.stream.advance()?;
        }
        while !self.ended {
            if !self.stream.advance()? {
                self.ended = true;
                break;
            }
            if let Some(row) = self.gathered.take(&self.form, &self.stream.texts()) {
                self.row = row;
                return Ok(true);
            }
        }
        match self.gathered.finish() {
            Some(row) => self.row = row,
            None => return Ok(false),
        }
        Ok(true)
    }
}

#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) name: String,
    pub(crate) table: Table,
    first_group: usize,
    first_column: usize,
    /// Time 0 minus that of the earliest table, s.
    offset_s: f64,
}

impl Part {
    /// The table's columns among the requested columns of the log, as indices of the table.
    pub(crate) fn own(&self, wanted: &[usize]) -> Vec<usize> {
        let columns = self.first_column..self.first_column + self.table.layout.columns.len();
        wanted
            .iter()
            .filter(|column| columns.contains(column))
            .map(|column| column - self.first_column)
            .collect()
    }

    pub(crate) fn forward_row(&self, row: Row<'_>, sink: &mut RowSink<'_>) -> Result<(), LogError> {
        sink(Row { group: row.group + self.first_group, t_s: row.t_s + self.offset_s, ..row })
    }
}

/// Joins tables; `word` is the format's term for a table. Returns the layout of the log and its parts, with the tables in their original
/// order, or the errors if no table can be read.
pub(crate) fn join_tables(
    word: &str,
    found: Vec<(String, Table)>,
    problems: Vec<LogFinding>,
) -> Result<(Layout, Vec<Part>), String> {
    if found.is_empty() {
        let problems: Vec<String> = problems.iter().map(LogFinding::to_string).collect();
        return Err(if problems.is_empty() {
            format!("no {word} contains data")
        } else {
            problems.join("; ")
        });
    }
    let several = found.len() > 1;
    let mut layout = Layout::default();
    let starts: Option<Vec<u64>> = found.iter().map(|(_, table)| table.layout.start_time_ns).collect();
    layout.start_time_ns = found.iter().filter_map(|(_, table)| table.layout.start_time_ns).min();
    let mut parts = Vec::new();
    for (index, (name, mut table)) in found.into_iter().enumerate() {
        let (first_group, first_column) = (layout.groups.len(), layout.columns.len());
        for group in &table.layout.groups {
            let mut group = group.clone();
            group.name = match (several, group.name.is_empty()) {
                (false, _) => group.name,
                (true, true) => name.clone(),
                (true, false) => format!("{name}: {}", group.name),
            };
            layout.groups.push(group);
        }
        layout.columns.extend(table.layout.columns.iter().cloned().map(|mut column| {
            column.group += first_group;
            column
        }));
        let findings = table.layout.findings.drain(..);
        layout.findings.extend(findings.map(|finding| LogFinding::InTable {
            part: word.to_owned(),
            name: name.clone(),
            finding: Box::new(finding),
        }));
        // If one table has no date, all are assumed to start together.
        let start = starts.as_ref().and_then(|starts| starts.get(index)).copied();
        let offset_s = start.zip(layout.start_time_ns).map_or(0.0, |(own, first)| (own - first) as f64 / 1e9);
        parts.push(Part { name, table, first_group, first_column, offset_s });
    }
    layout.findings.extend(problems);
    Ok((layout, parts))
}
