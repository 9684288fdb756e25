//! Groups and columns of a log, as its reader detected them.

use crate::logs::LogFinding;
use serde::Serialize;

/// Groups and columns of a log.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Layout {
    /// Columns that share a clock, in the order of the file.
    pub groups: Vec<Group>,
    /// Columns without the clocks, in the order of the file.
    pub columns: Vec<Column>,
    /// Detected properties.
    pub findings: Vec<LogFinding>,
    /// Time 0 of all groups in nanoseconds since 1970-01-01 in the log's time zone; `None` if the log has no dates.
    pub start_time_ns: Option<u64>,
}

/// Columns that share a clock.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Group {
    /// Name: a sheet, a group of the format, the clock's column; empty if the log has one group without a name.
    pub name: String,
    /// Description of the clock.
    pub clock: String,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Column {
    /// Name without its unit; distinct within a group.
    pub name: String,
    /// The header's cell as written, with the unit.
    pub header: String,
    /// Unit as written; `None` if the log gives none.
    pub unit: Option<String>,
    /// Long name or comment; empty if there is none.
    pub description: String,
    /// Index of its group.
    pub group: usize,
}

impl Layout {
    /// Adds a finding unless it is there already.
    pub fn add_finding(&mut self, finding: Option<LogFinding>) {
        let is_new = |finding: &LogFinding| !self.findings.contains(finding);
        self.findings.extend(finding.filter(is_new));
    }

    /// The columns of `wanted` that belong to a group.
    pub fn members(&self, group: usize, wanted: &[usize]) -> Vec<usize> {
        let belongs = |index: &usize| self.columns.get(*index).is_some_and(|column| column.group == group);
        wanted.iter().copied().filter(belongs).collect()
    }

    /// Columns of that name, or with that header as a whole, in a group of that name (any if `topic` is empty).
    pub fn find(&self, topic: &str, field: &str) -> Vec<usize> {
        let in_group = |column: &Column| {
            topic.is_empty() || self.groups.get(column.group).is_some_and(|group| group.name == topic)
        };
        let by = |text: fn(&Column) -> &str| -> Vec<usize> {
            let rows = self.columns.iter().enumerate();
            rows.filter(|(_, column)| in_group(column) && text(column) == field)
                .map(|(index, _)| index)
                .collect()
        };
        let named = by(|column| &column.name);
        if named.is_empty() { by(|column| &column.header) } else { named }
    }
}
