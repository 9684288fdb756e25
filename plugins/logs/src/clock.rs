//! The time of a row.

use crate::cells::Cells;
use crate::instant::NS_PER_DAY;
use mapper_logs::DateOrder;

/// The source of a group's time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Clock {
    /// A counter.
    Count { column: usize, unit_s: f64 },
    /// Date and time of day, in one column or in two.
    Instant { date: Option<usize>, time: usize, order: DateOrder },
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
    /// If several rows share one reading: seconds between them, and their number.
    pub(crate) spread: Option<(f64, usize)>,
}

impl Clock {
    /// Seconds of a counter.
    pub(crate) fn count_s(&self, cells: &dyn Cells) -> Option<f64> {
        match self {
            Clock::Count { column, unit_s } => Some(cells.number(*column))
                .filter(|value| value.is_finite())
                .map(|value| scaled(value, *unit_s)),
            _ => None,
        }
    }

    /// Nanoseconds of a date or a time of day.
    pub(crate) fn instant_ns(&self, cells: &dyn Cells) -> Option<i64> {
        let Clock::Instant { date, time, order } = self else { return None };
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

/// Milliseconds are divided, so that 100 ms are 0.1 s to the last digit.
fn scaled(value: f64, unit_s: f64) -> f64 {
    if unit_s < 1.0 { value / (1.0 / unit_s).round() } else { value * unit_s }
}

/// Reads a clock row by row.
#[derive(Debug)]
pub(crate) struct ClockHand {
    clock: GroupClock,
    rows: u64,
    days_ns: i64,
    last_ns: Option<i64>,
    last_s: f64,
    shared: usize,
}

impl ClockHand {
    pub(crate) fn new(clock: GroupClock) -> Self {
        ClockHand { clock, rows: 0, days_ns: 0, last_ns: None, last_s: f64::NAN, shared: 0 }
    }

    /// The row's time, s; `None` if the group has no sample in it.
    pub(crate) fn time_s(&mut self, cells: &dyn Cells) -> Option<f64> {
        let read_s = match &self.clock.clock {
            Clock::Rate { interval_s } => {
                self.rows += 1;
                return Some((self.rows - 1) as f64 * interval_s);
            }
            Clock::Count { .. } => self.clock.clock.count_s(cells)? - self.clock.zero_s,
            Clock::Instant { .. } => {
                let ns = self.clock.clock.instant_ns(cells)?;
                // A time of day without a date continues after midnight.
                if self.last_ns.is_some_and(|last| ns < last.saturating_sub(NS_PER_DAY / 2))
                    && ns.unsigned_abs() < 2 * NS_PER_DAY.unsigned_abs()
                {
                    self.days_ns = self.days_ns.saturating_add(NS_PER_DAY);
                }
                self.last_ns = Some(ns);
                ns.saturating_add(self.days_ns).saturating_sub(self.clock.zero_ns) as f64 / 1e9
            }
        };
        let Some((interval_s, rows)) = self.clock.spread else { return Some(read_s) };
        self.shared = if read_s == self.last_s { self.shared + 1 } else { 0 };
        self.last_s = read_s;
        Some(read_s + interval_s * self.shared.min(rows.saturating_sub(1)) as f64)
    }
}
