//! The first rows of a table, from which its clocks are found; columns that count time, with the seconds per count; the clock of a table, which
//! gives the time of each row.

use crate::table_head::HeadColumn;
use crate::tables::table_row::{Cell, Cells};
use mapper_recording::Kind;
use mapper_recording::logs::LogFinding;
use mapper_table::{DateOrder, NS_PER_DAY, header_unit, read_number};

/// Maximum number of rows of a table in its sample.
pub(crate) const HEAD_ROWS: usize = 400;

pub(crate) struct Sample<'a> {
    pub(crate) columns: &'a [HeadColumn],
    pub(crate) rows: &'a [Vec<String>],
    pub(crate) decimal: u8,
}

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

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Clock {
    /// A counter.
    Count { column: usize, unit_s: f64 },
    /// Date and time of day, in one column or in two. A reading without a date restarts after `period_ns`: a day, or an hour
    /// if the hours are not written.
    Instant { date: Option<usize>, time: usize, order: DateOrder, period_ns: i64 },
    /// No clock: rows have a fixed rate.
    Rate { interval_s: f64 },
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GroupClock {
    pub(crate) clock: Clock,
    /// Clock reading at time 0, s.
    pub(crate) zero_s: f64,
    /// The same for dates, ns.
    pub(crate) zero_ns: i64,
    /// Set if several rows share one reading.
    pub(crate) spread: Option<Spread>,
    pub(crate) disordered: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spread {
    pub(crate) interval_s: f64,
    pub(crate) rows: usize,
    /// Number of rows missing at the first reading, since the log began within it.
    pub(crate) missing_at_start: usize,
}

impl Clock {
    pub(crate) fn count_s(&self, cells: &dyn Cells) -> Option<f64> {
        match self {
            Clock::Count { column, unit_s } => Some(cells.number(*column))
                .filter(|value| value.is_finite())
                .map(|value| count_to_s(value, *unit_s)),
            _ => None,
        }
    }

    pub(crate) fn instant_ns(&self, cells: &dyn Cells) -> Option<i64> {
        let Clock::Instant { date, time, order, .. } = self else { return None };
        let mut instant = cells.instant(*time, *order)?;
        if let Some(date) = date {
            instant.day = Some(cells.instant(*date, *order)?.day?);
        }
        Some(instant.ns())
    }

    pub(crate) fn columns(&self) -> Vec<usize> {
        match self {
            Clock::Count { column, .. } => vec![*column],
            Clock::Instant { date, time, .. } => date.iter().copied().chain([*time]).collect(),
            Clock::Rate { .. } => Vec::new(),
        }
    }
}

/// Converts a count to seconds. Milliseconds are divided, so that 100 ms is exactly the f64 0.1 s.
fn count_to_s(value: f64, unit_s: f64) -> f64 {
    if unit_s < 1.0 { value / (1.0 / unit_s).round() } else { value * unit_s }
}

#[derive(Debug)]
pub(crate) struct ClockReader {
    clock: GroupClock,
    rows: u64,
    /// Offset because the readings restarted, ns.
    added_ns: i64,
    last_ns: Option<i64>,
    last_s: f64,
    shared: usize,
    has_hour_back: bool,
}

impl ClockReader {
    pub(crate) fn new(clock: GroupClock) -> Self {
        let shared = clock.spread.map_or(0, |spread| spread.missing_at_start);
        ClockReader {
            clock,
            rows: 0,
            added_ns: 0,
            last_ns: None,
            last_s: f64::NAN,
            shared,
            has_hour_back: false,
        }
    }

    /// A remark if local time went back at the end of daylight saving.
    pub(crate) fn remark(&self) -> Option<LogFinding> {
        self.has_hour_back.then_some(LogFinding::HourBack)
    }

    /// The row's time, s; `None` if the group has no sample in it.
    pub(crate) fn time_s(&mut self, cells: &dyn Cells) -> Option<f64> {
        let read_s = match &self.clock.clock {
            Clock::Rate { interval_s } => {
                self.rows += 1;
                return Some((self.rows - 1) as f64 * interval_s);
            }
            Clock::Count { .. } => self.clock.clock.count_s(cells)? - self.clock.zero_s,
            Clock::Instant { period_ns, .. } => {
                let ns = self.clock.clock.instant_ns(cells)?;
                let last_ns = self.last_ns.replace(ns);
                let added_ns = last_ns.map_or(0, |last| restart_offset_ns(last, ns, *period_ns));
                self.has_hour_back |= added_ns > 0 && ns >= MIN_DATED_NS;
                self.added_ns = self.added_ns.saturating_add(added_ns);
                ns.saturating_add(self.added_ns).saturating_sub(self.clock.zero_ns) as f64 / 1e9
            }
        };
        let Some(spread) = self.clock.spread else { return Some(read_s) };
        if !self.last_s.is_nan() {
            self.shared = if read_s == self.last_s { self.shared + 1 } else { 0 };
        }
        self.last_s = read_s;
        let rows = self.shared.min(spread.rows.saturating_sub(1)) as f64 - spread.missing_at_start as f64;
        Some(read_s + spread.interval_s * rows)
    }
}

/// An hour, ns: local time goes back by this at the end of daylight saving.
pub(crate) const NS_PER_HOUR: i64 = NS_PER_DAY / 24;

/// Offset to add from here on because a clock's readings restarted, ns: a period if they have no date, an hour if local time goes back at
/// the end of daylight saving, else 0.
pub(crate) fn restart_offset_ns(last_ns: i64, ns: i64, period_ns: i64) -> i64 {
    let is_dated = ns >= MIN_DATED_NS;
    let back_ns = last_ns.saturating_sub(ns);
    match is_dated {
        false if back_ns > period_ns / 2 => period_ns,
        // The step is an hour minus the time between two rows.
        true if (NS_PER_HOUR - NS_PER_MINUTE..NS_PER_HOUR).contains(&back_ns) => NS_PER_HOUR,
        _ => 0,
    }
}

/// Minimum reading with a date, ns: days of the year and durations are smaller.
const MIN_DATED_NS: i64 = 367 * NS_PER_DAY;

/// A minute, ns: logs with longer intervals have no transients.
const NS_PER_MINUTE: i64 = NS_PER_HOUR / 60;
