//! The clock of a table: the time of each row.

use crate::tables::table_row::Cells;
use mapper_recording::logs::LogFinding;
use mapper_table::{DateOrder, NS_PER_DAY};

/// The source of a group's time.
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

/// A clock, its start, and its resolution.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GroupClock {
    pub(crate) clock: Clock,
    /// Clock reading at time 0, s.
    pub(crate) zero_s: f64,
    /// The same for dates, ns.
    pub(crate) zero_ns: i64,
    /// Set if several rows share one reading.
    pub(crate) spread: Option<Spread>,
    /// Whether rows are out of order and must be sorted by time.
    pub(crate) disordered: bool,
}

/// Rows that share a reading of the clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spread {
    /// Seconds between them.
    pub(crate) interval_s: f64,
    /// Their number.
    pub(crate) rows: usize,
    /// Number of rows missing at the first reading, since the log began within it.
    pub(crate) missing_at_start: usize,
}

impl Clock {
    /// Seconds of a counter.
    pub(crate) fn count_s(&self, cells: &dyn Cells) -> Option<f64> {
        match self {
            Clock::Count { column, unit_s } => Some(cells.number(*column))
                .filter(|value| value.is_finite())
                .map(|value| count_to_s(value, *unit_s)),
            _ => None,
        }
    }

    /// Nanoseconds of a date or a time of day.
    pub(crate) fn instant_ns(&self, cells: &dyn Cells) -> Option<i64> {
        let Clock::Instant { date, time, order, .. } = self else { return None };
        let mut instant = cells.instant(*time, *order)?;
        if let Some(date) = date {
            instant.day = Some(cells.instant(*date, *order)?.day?);
        }
        Some(instant.ns())
    }

    /// Columns of the clock; a date may have its own column next to the time of day.
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

/// Reads a clock row by row.
#[derive(Debug)]
pub(crate) struct ClockReader {
    clock: GroupClock,
    rows: u64,
    /// Offset because the readings restarted, ns.
    added_ns: i64,
    last_ns: Option<i64>,
    last_s: f64,
    shared: usize,
    /// Whether a reading with a date went back by an hour.
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
