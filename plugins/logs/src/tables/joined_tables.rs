//! Joins several tables of one file to one log: sheets of a workbook, groups of a measurement.

use crate::tables::table_log::Table;
use mapper_recording::logs::{Layout, LogError, LogFinding, Row, RowSink};

/// A table of the file.
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
