//! A table as a log: its clocks, its columns, and its stream of rows.

use crate::cells::Rows;
use crate::clock::ClockHand;
use crate::clock_choice::{Clocks, Sample, choose};
use crate::table_head::{TableHead, look};
use mapper_logs::{Column, Layout, LogError, LogOptions, Row, RowSink};

/// The analysis of a table.
#[derive(Debug)]
pub(crate) struct Table {
    pub(crate) layout: Layout,
    clocks: Clocks,
    /// Column of the table for each column of the layout.
    sources: Vec<usize>,
    data_row: usize,
    missing: Vec<f64>,
}

impl Table {
    /// Analyses the first rows of a table.
    pub(crate) fn look(rows: &[Vec<String>], decimal: u8, options: &LogOptions) -> Result<Table, String> {
        let TableHead { columns, data_row, mut findings } = look(rows, decimal, options)?;
        let sample = Sample { columns: &columns, rows: rows.get(data_row..).unwrap_or_default(), decimal };
        let mut clocks = choose(&sample, options)?;
        findings.append(&mut clocks.findings);
        let mut layout = Layout {
            groups: clocks.groups.iter().map(|(group, _)| group.clone()).collect(),
            columns: Vec::new(),
            findings,
            start_time_ns: clocks.start_time_ns,
        };
        let mut sources = Vec::new();
        for (source, column) in columns.into_iter().enumerate() {
            let Some(group) = clocks.group_of.get(source).copied().flatten() else { continue };
            sources.push(source);
            layout.columns.push(Column {
                name: column.name,
                header: column.header,
                unit: column.unit,
                description: column.description,
                group,
            });
        }
        Ok(Table { layout, clocks, sources, data_row, missing: options.missing.clone() })
    }

    /// Returns the rows of the wanted columns; `rows` must be before the first row of the table.
    pub(crate) fn rows(
        &self,
        rows: &mut dyn Rows,
        wanted: &[usize],
        sink: &mut RowSink<'_>,
    ) -> Result<(), LogError> {
        for _ in 0..self.data_row {
            if !rows.advance()? {
                return Ok(());
            }
        }
        let mut groups: Vec<(usize, ClockHand, Vec<usize>, Vec<f64>)> = Vec::new();
        for (index, (_, clock)) in self.clocks.groups.iter().enumerate() {
            let of_group = |column: &&usize| {
                self.layout.columns.get(**column).is_some_and(|column| column.group == index)
            };
            let sources: Vec<usize> = wanted
                .iter()
                .filter(of_group)
                .filter_map(|column| self.sources.get(*column).copied())
                .collect();
            if !sources.is_empty() {
                groups.push((index, ClockHand::new(clock.clone()), sources, Vec::new()));
            }
        }
        while rows.advance()? {
            for (group, hand, sources, values) in &mut groups {
                let Some(t_s) = hand.time_s(&*rows) else { continue };
                values.clear();
                values.extend(sources.iter().map(|source| {
                    let value = rows.number(*source);
                    if self.missing.contains(&value) { f64::NAN } else { value }
                }));
                sink(Row { group: *group, t_s, values })?;
            }
        }
        Ok(())
    }
}
