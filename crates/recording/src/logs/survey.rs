//! Surveys all columns of a log in one pass: ranges, gaps, and traces of a bounded number of means, which are drawn in one line of text.

use crate::logs::{Log, LogError, Row};
use crate::samples::log_clock::LogClock;
pub use crate::samples::log_clock::Restart;
use mapper_numerics::statistics::nearest_rank;
use serde::Serialize;

/// Number of intervals that determine the typical one. Bound: memory.
const MAX_INTERVALS: usize = 4096;

/// Typical intervals above which a step of the clock is a gap. Bound: loggers jitter by less.
const GAP_INTERVALS: f64 = 5.0;

/// Maximum number of listed gaps; further ones are only counted. Bound: memory; further ones are only counted.
const MAX_LISTED_GAPS: usize = 100;

/// Contents of a log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Survey {
    /// By group of the layout.
    pub groups: Vec<GroupSurvey>,
    /// By column of the layout.
    pub columns: Vec<ColumnSurvey>,
}

/// The clock of a group.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct GroupSurvey {
    /// Rows.
    pub rows: u64,
    /// First time, s; NaN without rows.
    pub first_s: f64,
    /// Last time, s.
    pub last_s: f64,
    /// Typical interval between rows, s; NaN below two rows.
    pub interval_s: f64,
    /// The first gaps, at most 100.
    pub gaps: Vec<Gap>,
    /// Number of gaps.
    pub gap_count: u64,
    /// Rows with a time not after the previous row's.
    pub backward: u64,
    /// The row at which the clock starts again, as if the file had two runs.
    pub restart: Option<Restart>,
    #[serde(skip)]
    clock: LogClock,
    #[serde(skip)]
    intervals: Vec<f64>,
    /// Times of the traces of the group's columns.
    #[serde(skip)]
    pub trace: Trace,
}

/// A time without rows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// Last row before it, s.
    pub from_s: f64,
    /// First row after it, s.
    pub to_s: f64,
}

/// The values of a column, in its own unit.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnSurvey {
    /// Cells with a number.
    pub count: u64,
    /// Cells without one.
    pub missing: u64,
    /// Minimum; infinite without values.
    pub min: f64,
    /// Maximum; minus infinity without values.
    pub max: f64,
    /// The values over time.
    pub trace: Trace,
}

impl Default for ColumnSurvey {
    fn default() -> Self {
        ColumnSurvey {
            count: 0,
            missing: 0,
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            trace: Trace::default(),
        }
    }
}

impl ColumnSurvey {
    /// The quantile of the trace at a share of 0 to 1; NaN without values.
    pub fn quantile(&self, share: f64) -> f64 {
        let values = self.trace.means().into_iter().filter(|value| value.is_finite());
        nearest_rank(values, share).unwrap_or(f64::NAN)
    }

    /// Whether there is any value.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

impl GroupSurvey {
    fn add_time(&mut self, t_s: f64) {
        if self.restart.is_none() {
            self.restart = self.clock.push(t_s, &[], &mut |_, _| {}).err();
        }
        if self.rows == 0 {
            (self.first_s, self.last_s) = (t_s, t_s);
        } else {
            let step_s = t_s - self.last_s;
            if step_s > 0.0 {
                self.add_interval(step_s, t_s);
            } else {
                self.backward += 1;
            }
            self.last_s = t_s;
        }
        self.rows += 1;
        self.trace.push(t_s);
    }

    fn add_interval(&mut self, step_s: f64, t_s: f64) {
        if self.intervals.len() < MAX_INTERVALS {
            self.intervals.push(step_s);
        }
        if step_s > GAP_INTERVALS * self.typical_s() {
            self.gap_count += 1;
            if self.gaps.len() < MAX_LISTED_GAPS {
                self.gaps.push(Gap { from_s: self.last_s, to_s: t_s });
            }
        }
    }

    /// The median interval so far; constant after [`MAX_INTERVALS`].
    fn typical_s(&mut self) -> f64 {
        let settled = self.intervals.len() >= MAX_INTERVALS || !self.intervals.len().is_multiple_of(64);
        if self.interval_s.is_finite() && settled {
            return self.interval_s;
        }
        self.interval_s = self.median_interval_s();
        self.interval_s
    }

    fn median_interval_s(&self) -> f64 {
        nearest_rank(&self.intervals, 0.5).unwrap_or(f64::NAN)
    }

    fn finish(&mut self) {
        self.interval_s = self.median_interval_s();
        self.intervals = Vec::new();
    }
}

/// Reads a log and surveys every column.
pub fn survey(log: &mut dyn Log) -> Result<Survey, LogError> {
    let layout = log.layout().clone();
    let mut survey = Survey {
        groups: vec![
            GroupSurvey {
                first_s: f64::NAN,
                last_s: f64::NAN,
                interval_s: f64::NAN,
                ..GroupSurvey::default()
            };
            layout.groups.len()
        ],
        columns: vec![ColumnSurvey::default(); layout.columns.len()],
    };
    let wanted: Vec<usize> = (0..layout.columns.len()).collect();
    let members: Vec<Vec<usize>> =
        (0..layout.groups.len()).map(|group| layout.members(group, &wanted)).collect();
    let mut take = |row: Row<'_>| {
        if let Some(group) = survey.groups.get_mut(row.group).filter(|_| row.t_s.is_finite()) {
            group.add_time(row.t_s);
        }
        for (column, value) in members.get(row.group).into_iter().flatten().zip(row.values) {
            let Some(column) = survey.columns.get_mut(*column) else { continue };
            column.trace.push(*value);
            if value.is_finite() {
                column.count += 1;
                column.min = column.min.min(*value);
                column.max = column.max.max(*value);
            } else {
                column.missing += 1;
            }
        }
        Ok(())
    };
    log.rows(&wanted, &mut take)?;
    survey.groups.iter_mut().for_each(GroupSurvey::finish);
    Ok(survey)
}

/// Maximum number of means; a power of two. Bound: memory; more than a line on screen shows.
const MAX_BINS: usize = 512;

/// A series as means over equal numbers of rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    bins: Vec<(f64, u32)>,
    rows_per_bin: u64,
    rows: u64,
}

impl Default for Trace {
    fn default() -> Self {
        Trace { bins: Vec::new(), rows_per_bin: 1, rows: 0 }
    }
}

impl Trace {
    /// Adds the next row; NaN counts as a row without a value.
    pub fn push(&mut self, value: f64) {
        let bin = usize::try_from(self.rows / self.rows_per_bin).unwrap_or(MAX_BINS);
        if bin >= MAX_BINS {
            self.bins = self
                .bins
                .chunks(2)
                .map(|pair| pair.iter().fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1)))
                .collect();
            self.rows_per_bin *= 2;
            return self.push(value);
        }
        if bin == self.bins.len() {
            self.bins.push((0.0, 0));
        }
        if let Some(bin) = self.bins.get_mut(bin).filter(|_| value.is_finite()) {
            bin.0 += value;
            bin.1 += 1;
        }
        self.rows += 1;
    }

    /// The means, in order; NaN if there was no value.
    pub fn means(&self) -> Vec<f64> {
        self.bins.iter().map(|(sum, count)| sum / f64::from(*count)).collect()
    }
}

/// Eighths of a line's height.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// A sparkline of at most `width` characters from the minimum to the maximum of `values`; each character shows the mean of its share of
/// them, a blank if it has none.
pub fn sparkline(values: &[f64], width: usize) -> String {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let high = finite().fold(f64::NEG_INFINITY, f64::max);
    let width = width.min(values.len());
    let share = |index: usize| {
        let part =
            values.get(index * values.len() / width..(index + 1) * values.len() / width).unwrap_or_default();
        let (mut sum, mut count) = (0.0, 0.0);
        for value in part.iter().filter(|value| value.is_finite()) {
            sum += value;
            count += 1.0;
        }
        sum / count
    };
    let bar = |value: f64| match value {
        value if !value.is_finite() => ' ',
        _ if high <= low => BARS[3],
        value => BARS[((BARS.len() as f64 * (value - low) / (high - low)) as usize).min(BARS.len() - 1)],
    };
    (0..width).map(|index| bar(share(index))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_ramp_keeps_its_shape_in_few_means() {
        let mut trace = Trace::default();
        (0..100_000).for_each(|row| trace.push(f64::from(row)));
        let means = trace.means();
        assert!((MAX_BINS / 4..=MAX_BINS).contains(&means.len()), "{}", means.len());
        assert!(means.is_sorted());
        let whole: f64 = means.iter().take(means.len() - 1).sum::<f64>() / (means.len() - 1) as f64;
        assert!((whole / 50_000.0 - 1.0).abs() < 0.02, "{whole}");
    }

    #[test]
    fn a_ramp_rises_a_constant_is_level_and_a_gap_is_blank() {
        let ramp: Vec<f64> = (0..16).map(f64::from).collect();
        assert_eq!(sparkline(&ramp, 8), "▁▂▃▄▅▆▇█");
        assert_eq!(sparkline(&[2.0; 5], 3), "▄▄▄");
        assert_eq!(sparkline(&[0.0, f64::NAN, 1.0], 3), "▁ █");
        assert_eq!(sparkline(&[], 8), "");
    }
}
