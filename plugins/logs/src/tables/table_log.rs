//! A table as a log: its clocks, its columns, and its stream of rows.

use crate::clock::{ClockReader, Sample};
use crate::clock_choice::{Clocks, choose_clocks};
use crate::table_head::{TableHead, analyse_head};
use crate::tables::table_row::{Cell, Cells, RowSorter, Rows};
use mapper_recording::logs::{Column, Layout, LogError, LogFinding, LogOptions, Row, RowSink};
use std::collections::BTreeMap;

struct GroupReader {
    group: usize,
    clock: ClockReader,
    sorter: Option<RowSorter>,
    sources: Vec<usize>,
    values: Vec<f64>,
}

struct CellsWithUnits<'a> {
    row: &'a dyn Rows,
    units: &'a BTreeMap<usize, String>,
}

impl Cells for CellsWithUnits<'_> {
    fn cell(&self, column: usize) -> Cell<'_> {
        self.row.cell(column)
    }

    fn decimal(&self) -> u8 {
        self.row.decimal()
    }

    fn number(&self, column: usize) -> f64 {
        match self.units.get(&column) {
            None => self.row.number(column),
            Some(unit) => self.row.number_in(column, unit),
        }
    }
}

#[derive(Debug)]
pub(crate) struct Table {
    pub(crate) layout: Layout,
    clocks: Clocks,
    sources: Vec<usize>,
    data_row: usize,
    missing: Vec<f64>,
    /// Unit after each number of a column, if the cells have one.
    cell_units: BTreeMap<usize, String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Origin {
    /// A text or a sheet: its head is in rows.
    Rows,
    /// A file of columns, which has no rows of a head.
    Columns,
    /// As `Columns`, with the interval of the samples from the file.
    #[cfg_attr(not(feature = "tdms"), allow(dead_code, reason = "only TDMS has waveforms"))]
    Waveform,
}

impl Table {
    pub(crate) fn analyse(
        rows: &[Vec<String>],
        decimal: u8,
        options: &LogOptions,
        origin: Origin,
    ) -> Result<Table, String> {
        let TableHead { columns, data_row, cell_units, mut findings } = analyse_head(rows, decimal, options)?;
        if origin != Origin::Rows {
            findings.retain(|finding| !matches!(finding, LogFinding::Header { .. }));
        }
        let sample = Sample { columns: &columns, rows: rows.get(data_row..).unwrap_or_default(), decimal };
        let mut clocks = choose_clocks(&sample, options)?;
        if origin != Origin::Waveform {
            findings.append(&mut clocks.findings);
        }
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
        Ok(Table { layout, clocks, sources, data_row, missing: options.missing.clone(), cell_units })
    }

    pub(crate) fn clock_columns(&self) -> Vec<usize> {
        let of = self.clocks.group_of.iter().enumerate();
        of.filter(|(_, group)| group.is_none()).map(|(column, _)| column).collect()
    }

    pub(crate) fn data_row(&self) -> usize {
        self.data_row
    }

    pub(crate) fn named_columns(&self) -> impl Iterator<Item = (usize, &str)> {
        self.sources.iter().copied().zip(self.layout.columns.iter().map(|column| column.name.as_str()))
    }

    /// Forwards the rows of the requested columns, and returns a remark on their clock; `rows` must be before the table's first row.
    pub(crate) fn rows(
        &self,
        rows: &mut dyn Rows,
        wanted: &[usize],
        sink: &mut RowSink<'_>,
    ) -> Result<Option<LogFinding>, LogError> {
        for _ in 0..self.data_row {
            if !rows.advance()? {
                return Ok(None);
            }
        }
        let mut groups: Vec<GroupReader> = Vec::new();
        for (index, (_, clock)) in self.clocks.groups.iter().enumerate() {
            let members = self.layout.members(index, wanted);
            let sources: Vec<usize> =
                members.into_iter().filter_map(|column| self.sources.get(column).copied()).collect();
            if !sources.is_empty() {
                groups.push(GroupReader {
                    group: index,
                    sorter: clock.disordered.then(RowSorter::default),
                    clock: ClockReader::new(clock.clone()),
                    sources,
                    values: Vec::new(),
                });
            }
        }
        while rows.advance()? {
            let row = CellsWithUnits { row: &*rows, units: &self.cell_units };
            for reader in &mut groups {
                let Some(t_s) = reader.clock.time_s(&row) else { continue };
                reader.values.clear();
                for source in &reader.sources {
                    let value = row.number(*source);
                    reader.values.push(if self.missing.contains(&value) { f64::NAN } else { value });
                }
                match &mut reader.sorter {
                    None => sink(Row { group: reader.group, t_s, values: &reader.values })?,
                    Some(sorter) => {
                        if let Some((t_s, values)) = sorter.exchange(t_s, &reader.values) {
                            sink(Row { group: reader.group, t_s, values: &values })?;
                        }
                    }
                }
            }
        }
        let mut remark = None;
        for reader in groups {
            remark = remark.or(reader.clock.remark());
            for (t_s, values) in reader.sorter.unwrap_or_default().rest() {
                sink(Row { group: reader.group, t_s, values: &values })?;
            }
        }
        Ok(remark)
    }
}
