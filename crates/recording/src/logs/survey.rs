//! What every column of a log holds, in one pass over it.

use crate::logs::trace::Trace;
use crate::logs::{Log, LogError, Row};
use serde::Serialize;

/// Intervals from which the typical one is taken.
const INTERVALS: usize = 4096;

/// A hole in a clock is a step of more than this many typical intervals.
const GAP_INTERVALS: f64 = 5.0;

/// Most gaps that are listed; more are counted.
const GAP_LIMIT: usize = 100;

/// What a log holds.
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
    /// Gaps, the first ones of many.
    pub gaps: Vec<Gap>,
    /// How many gaps there are.
    pub gap_count: u64,
    /// Rows whose time is not after that of the row before.
    pub backward: u64,
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
    /// Least value; infinite if there is none.
    pub min: f64,
    /// Largest value; minus infinity if there is none.
    pub max: f64,
    /// The course of it.
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
    /// A value that this share of the course stays below; NaN without values.
    pub fn quantile(&self, share: f64) -> f64 {
        let mut values: Vec<f64> = self.trace.means().into_iter().filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let at = (share.clamp(0.0, 1.0) * values.len().saturating_sub(1) as f64).round() as usize;
        values.get(at).copied().unwrap_or(f64::NAN)
    }

    /// Whether there is any value.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

impl GroupSurvey {
    fn time(&mut self, t_s: f64) {
        if self.rows == 0 {
            (self.first_s, self.last_s) = (t_s, t_s);
        } else {
            let step_s = t_s - self.last_s;
            if step_s > 0.0 {
                self.step(step_s, t_s);
            } else {
                self.backward += 1;
            }
            self.last_s = t_s;
        }
        self.rows += 1;
        self.trace.push(t_s);
    }

    /// Takes a step forward to `t_s`.
    fn step(&mut self, step_s: f64, t_s: f64) {
        if self.intervals.len() < INTERVALS {
            self.intervals.push(step_s);
        }
        if step_s > GAP_INTERVALS * self.typical_s() {
            self.gap_count += 1;
            if self.gaps.len() < GAP_LIMIT {
                self.gaps.push(Gap { from_s: self.last_s, to_s: t_s });
            }
        }
    }

    /// The typical interval so far: settled once enough rows have come.
    fn typical_s(&mut self) -> f64 {
        let settled = self.intervals.len() >= INTERVALS || !self.intervals.len().is_multiple_of(64);
        if self.interval_s.is_finite() && settled {
            return self.interval_s;
        }
        let mut intervals = self.intervals.clone();
        intervals.sort_by(f64::total_cmp);
        self.interval_s = intervals.get(intervals.len() / 2).copied().unwrap_or(f64::NAN);
        self.interval_s
    }

    fn finish(&mut self) {
        self.intervals.sort_by(f64::total_cmp);
        self.interval_s = self.intervals.get(self.intervals.len() / 2).copied().unwrap_or(f64::NAN);
        self.intervals = Vec::new();
    }
}

/// Looks at every column.
///
/// # Errors
/// [`LogError`] if the log cannot be read to its end.
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
    let of_group = |group: usize| -> Vec<usize> {
        wanted.iter().copied().filter(|column| layout.columns[*column].group == group).collect()
    };
    let members: Vec<Vec<usize>> = (0..layout.groups.len()).map(of_group).collect();
    let mut take = |row: Row<'_>| {
        if let Some(group) = survey.groups.get_mut(row.group).filter(|_| row.t_s.is_finite()) {
            group.time(row.t_s);
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
