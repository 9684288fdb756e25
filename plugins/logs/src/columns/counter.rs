//! The first rows of a table, from which its clocks are found, and the columns that count time, with the seconds per count.

use crate::columns::table_head::HeadColumn;
use crate::tables::table_row::{Cell, Cells};
use mapper_recording::Kind;
use mapper_table::{header_unit, read_number};

/// Maximum number of rows of a table in its sample.
pub(crate) const HEAD_ROWS: usize = 400;

/// The first rows of data.
pub(crate) struct Sample<'a> {
    pub(crate) columns: &'a [HeadColumn],
    pub(crate) rows: &'a [Vec<String>],
    pub(crate) decimal: u8,
}

/// A row of the sample.
pub(crate) struct SampleRow<'a> {
    cells: &'a [String],
    decimal: u8,
}

impl Sample<'_> {
    pub(crate) fn rows(&self) -> impl Iterator<Item = SampleRow<'_>> {
        self.rows.iter().map(|cells| SampleRow { cells, decimal: self.decimal })
    }
}

impl Cells for SampleRow<'_> {
    fn cell(&self, column: usize) -> Cell<'_> {
        self.cells.get(column).map_or(Cell::Empty, |text| Cell::Text(text.as_bytes()))
    }

    fn decimal(&self) -> u8 {
        self.decimal
    }

    // The units in cells are not known yet.
    fn number(&self, column: usize) -> f64 {
        self.cells.get(column).and_then(|cell| read_number(cell, self.decimal)).unwrap_or(f64::NAN)
    }
}

/// The cells of a column that are not empty.
pub(crate) fn cells<'a>(column: usize, sample: &'a Sample<'_>) -> impl Iterator<Item = &'a str> {
    sample
        .rows
        .iter()
        .filter_map(move |row| row.get(column))
        .map(String::as_str)
        .filter(|cell| !cell.is_empty())
}

/// Whether a column of numbers is labelled as a clock: by its name, unless its unit contradicts, or by its unit.
pub(crate) fn is_clock_name(column: &HeadColumn) -> bool {
    const NAMES: [&str; 40] = [
        "t",
        "ts",
        "time",
        "zeit",
        "timestamp",
        "timestamps",
        "zeitstempel",
        "uhrzeit",
        "datetime",
        "sec",
        "seconds",
        "sek",
        "sekunden",
        "elapsed",
        "clock",
        "ms",
        "msec",
        "t_s",
        "t_ms",
        "time_s",
        "time_ms",
        "elapsed_time",
        "sec_ms",
        "x_value",
        "temps",
        "tiempo",
        "horodatage",
        "fecha_hora",
        "date",
        "datum",
        "datenum",
        "fecha",
        "tempo",
        "tijd",
        "tid",
        "czas",
        "время",
        "时间",
        "日期时间",
        "時間",
    ];
    let unit = column.unit.as_deref().and_then(header_unit);
    let duration = unit.is_some_and(|unit| unit.kind == Kind::Duration);
    let name = column.name.to_lowercase().replace([' ', '-', '.', ':'], "_");
    let named = NAMES.contains(&name.as_str())
        || name.contains("time")
        || name.contains("zeit")
        || ["elapsed", "epoch", "unix"].iter().any(|start| name.starts_with(start));
    duration || named && column.unit.is_none()
}

/// Seconds per count: by its unit, its name, or, for epochs, its magnitude.
pub(crate) fn count_unit_s(column: usize, sample: &Sample<'_>) -> f64 {
    let Some(head) = sample.columns.get(column) else { return 1.0 };
    let unit = head.unit.as_deref().and_then(header_unit).filter(|unit| unit.kind == Kind::Duration);
    if let Some(unit) = unit {
        return unit.unit.to_inside(1.0);
    }
    let name = head.name.to_lowercase();
    let first: Option<f64> = cells(column, sample).find_map(|cell| read_number(cell, sample.decimal));
    let first = first.unwrap_or(0.0).abs();
    match first {
        // `sec.ms`: seconds, and milliseconds as their fraction.
        _ if name == "sec.ms" => 1.0,
        first if is_day_number(column, sample, first) => SECONDS_PER_DAY,
        _ if name == "ms" || name.ends_with("_ms") || name.contains("milli") || name.ends_with("msec") => {
            1e-3
        }
        first if first > 1e17 => 1e-9,
        first if first > 1e14 => 1e-6,
        first if first > 1e11 => 1e-3,
        _ => 1.0,
    }
}

const SECONDS_PER_DAY: f64 = 86_400.0;

/// Day numbers of 1970 to 2100 in spreadsheets (day 1 is 1 January 1900) and in MATLAB (day 1 is 1 January of year 0).
const DAY_NUMBERS: [std::ops::Range<f64>; 2] = [25_569.0..73_051.0, 719_529.0..767_011.0];

/// Whether a counter has the size and the steps of a day number: as seconds, its rows would be less than a millisecond apart.
fn is_day_number(column: usize, sample: &Sample<'_>, first: f64) -> bool {
    let readings: Vec<f64> =
        cells(column, sample).filter_map(|cell| read_number(cell, sample.decimal)).collect();
    let mut steps: Vec<f64> =
        readings.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let typical = steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY);
    DAY_NUMBERS.iter().any(|range| range.contains(&first)) && typical < 1e-3
}

/// Describes the unit of a counter.
pub(crate) fn describe_unit(unit_s: f64) -> String {
    match unit_s {
        1.0 => "seconds".to_owned(),
        0.001 => "milliseconds".to_owned(),
        60.0 => "minutes".to_owned(),
        3600.0 => "hours".to_owned(),
        SECONDS_PER_DAY => "days".to_owned(),
        other => format!("in {other} s"),
    }
}
