//! Rows of a log: isolated wrong times are skipped, a restarted clock ends the reading, and a fast log is averaged to the rate of the program's own recordings.

use mapper_core::SAMPLE_INTERVAL_S;
use mapper_numerics::statistics::nearest_rank;
use serde::Serialize;

/// Minimum difference from both neighbours for a wrong time, s. Bound: a day; a log has no such gap between two rows and back.
pub(crate) const STRAY_S: f64 = 86_400.0;

/// Maximum valid time, s. Bound: a century, within the range of a series' clock.
const MAX_TIME_S: f64 = 3.2e9;

/// Maximum number of intervals by which a clock may step back. Bound: loggers write some rows out of order.
pub(crate) const MAX_BACK_INTERVALS: f64 = 5.0;

/// Maximum step back that is always allowed, s. Bound: another clock synchronised it.
pub(crate) const MAX_BACK_S: f64 = 2.0;

/// Recent intervals whose median is the typical one. Bound: memory.
const KEPT_INTERVALS: usize = 15;

/// A clock that goes back, as if a file had two runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Restart {
    /// Number of the row of data, from 1.
    pub row: u64,
    /// Last time before it, s.
    pub from_s: f64,
    /// Its time, s.
    pub to_s: f64,
}

impl Restart {
    /// What it means, and the remedy; `of` names the clock.
    pub fn describe(&self, of: &str) -> String {
        let Restart { row, from_s, to_s } = self;
        format!(
            "the clock{of} goes back from {from_s} s to {to_s} s in row {row} of the data, as if the file had two runs: split it \
             there and give the parts as logs of their own, or name another clock with `time`"
        )
    }
}

/// Forwards rows with a delay of one row.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct LogClock {
    rows: u64,
    pending: Option<(f64, Vec<f64>)>,
    last_s: Option<f64>,
    intervals_s: Vec<f64>,
    pub(crate) strays: u64,
    /// The first skipped time, s.
    pub(crate) stray_s: f64,
}

/// Receives the time and the values of a row; an empty cell is NaN.
pub(crate) type TakeRow<'a> = dyn FnMut(f64, &[f64]) + 'a;

impl LogClock {
    pub(crate) fn push(&mut self, t_s: f64, values: &[f64], take: &mut TakeRow<'_>) -> Result<(), Restart> {
        self.rows += 1;
        if !t_s.is_finite() || t_s.abs() >= MAX_TIME_S {
            self.stray(t_s);
            return Ok(());
        }
        let mut row_values = Vec::new();
        if let Some((pending_s, pending_values)) = self.pending.take() {
            match self.last_s {
                // The very first row: the next one shows whether it is valid.
                None if (t_s - pending_s).abs() > STRAY_S => self.stray(pending_s),
                Some(last_s) if self.goes_back(last_s, pending_s) => {
                    if self.goes_back(last_s, t_s) {
                        return Err(Restart { row: self.rows - 1, from_s: last_s, to_s: pending_s });
                    }
                    self.stray(pending_s);
                }
                Some(last_s)
                    if pending_s - last_s > STRAY_S
                        && pending_s - t_s > STRAY_S
                        && !self.goes_back(last_s, t_s) =>
                {
                    self.stray(pending_s);
                }
                _ => self.accept(pending_s, &pending_values, take),
            }
            row_values = pending_values;
        }
        row_values.clear();
        row_values.extend_from_slice(values);
        self.pending = Some((t_s, row_values));
        Ok(())
    }

    pub(crate) fn finish(&mut self, take: &mut TakeRow<'_>) {
        let Some((pending_s, pending_values)) = self.pending.take() else { return };
        match self.last_s {
            Some(last_s) if pending_s - last_s > STRAY_S || self.goes_back(last_s, pending_s) => {
                self.stray(pending_s)
            }
            _ => self.accept(pending_s, &pending_values, take),
        }
    }

    fn accept(&mut self, t_s: f64, values: &[f64], take: &mut TakeRow<'_>) {
        if let Some(interval_s) = self.last_s.map(|last_s| t_s - last_s).filter(|step| *step > 0.0) {
            if self.intervals_s.len() >= KEPT_INTERVALS {
                self.intervals_s.remove(0);
            }
            self.intervals_s.push(interval_s);
        }
        self.last_s = Some(t_s);
        take(t_s, values);
    }

    fn stray(&mut self, t_s: f64) {
        if self.strays == 0 {
            self.stray_s = t_s;
        }
        self.strays += 1;
    }

    fn goes_back(&self, last_s: f64, t_s: f64) -> bool {
        let back_s = last_s - t_s;
        if back_s <= MAX_BACK_S {
            return false;
        }
        let typical_s = mapper_numerics::statistics::median(&self.intervals_s).unwrap_or(0.0);
        back_s > MAX_BACK_INTERVALS * typical_s
    }
}

/// Rounding of a time, ratio to the sample interval: a sample on a border belongs to the later block. Bound: the last digit of a stored time.
const BORDER_RATIO: f64 = 1e-6;

/// Maximum rate of a group that is not averaged, Hz. Bound: blocks would have one sample, or alternately one and two.
const MAX_UNAVERAGED_HZ: f64 = 15.0;

/// Rows from which the rate of a group is estimated. Bound: memory.
const RATE_ROWS: usize = 256;

/// Number of intervals monitored later: a log may be slow at rest and fast after a trigger.
const MONITORED_INTERVALS: u32 = u64::BITS;

/// The rows of one group, averaged if their rate is high.
#[derive(Debug, Default)]
pub(crate) struct BlockAverager {
    /// Rows that determine the rate.
    first: Vec<(f64, Vec<f64>)>,
    state: State,
}

#[derive(Debug, Default)]
enum State {
    #[default]
    Undecided,
    Unchanged(RecentIntervals),
    /// At any rate.
    Never,
    Averaging(Block),
}

#[derive(Debug)]
struct RecentIntervals {
    last_s: f64,
    /// A bit for each interval, set if it was short.
    short: u64,
}

impl Default for RecentIntervals {
    fn default() -> Self {
        RecentIntervals { last_s: f64::NAN, short: 0 }
    }
}

impl RecentIntervals {
    fn becomes_fast(&mut self, t_s: f64) -> bool {
        let step_s = t_s - self.last_s;
        if step_s > 0.0 || self.last_s.is_nan() {
            self.short = self.short << 1 | u64::from(step_s * MAX_UNAVERAGED_HZ < 1.0);
            self.last_s = t_s;
        }
        2 * self.short.count_ones() > MONITORED_INTERVALS
    }
}

#[derive(Debug, Default)]
struct Block {
    number: i64,
    rows: f64,
    time_sum_s: f64,
    sums: Vec<(f64, f64)>,
}

impl BlockAverager {
    /// One that does not wait for the rate: its rows are unchanged until most of the latest intervals are short.
    pub(crate) fn unbuffered() -> Self {
        BlockAverager { first: Vec::new(), state: State::Unchanged(RecentIntervals::default()) }
    }

    /// One that leaves all rows as they are.
    pub(crate) fn never() -> Self {
        BlockAverager { first: Vec::new(), state: State::Never }
    }

    pub(crate) fn push(&mut self, t_s: f64, values: &[f64], take: &mut TakeRow<'_>) {
        match &mut self.state {
            State::Unchanged(intervals) => {
                if intervals.becomes_fast(t_s) {
                    self.state = State::Averaging(Block::default());
                    return self.push(t_s, values, take);
                }
                take(t_s, values);
            }
            State::Never => take(t_s, values),
            State::Averaging(block) => block.push(t_s, values, take),
            State::Undecided => {
                self.first.push((t_s, values.to_owned()));
                if self.first.len() >= RATE_ROWS {
                    self.decide(take);
                }
            }
        }
    }

    pub(crate) fn finish(&mut self, take: &mut TakeRow<'_>) {
        if matches!(self.state, State::Undecided) {
            self.decide(take);
        }
        if let State::Averaging(block) = &mut self.state {
            block.flush(take);
        }
    }

    pub(crate) fn is_averaging(&self) -> bool {
        matches!(self.state, State::Averaging(_))
    }

    fn decide(&mut self, take: &mut TakeRow<'_>) {
        let intervals_s = self.first.windows(2).map(|pair| pair[1].0 - pair[0].0).filter(|step| *step > 0.0);
        let typical_s = nearest_rank(intervals_s, 0.5).unwrap_or(f64::INFINITY);
        self.state = if typical_s * MAX_UNAVERAGED_HZ < 1.0 {
            State::Averaging(Block::default())
        } else {
            State::Unchanged(RecentIntervals::default())
        };
        for (t_s, values) in std::mem::take(&mut self.first) {
            self.push(t_s, &values, take);
        }
    }
}

impl Block {
    fn push(&mut self, t_s: f64, values: &[f64], take: &mut TakeRow<'_>) {
        let number = (t_s / SAMPLE_INTERVAL_S + BORDER_RATIO).floor() as i64;
        if number != self.number {
            self.flush(take);
            self.number = number;
        }
        self.rows += 1.0;
        self.time_sum_s += t_s;
        self.sums.resize(values.len(), (0.0, 0.0));
        for (sum, value) in self.sums.iter_mut().zip(values).filter(|(_, value)| value.is_finite()) {
            sum.0 += value;
            sum.1 += 1.0;
        }
    }

    fn flush(&mut self, take: &mut TakeRow<'_>) {
        if self.rows > 0.0 {
            let means: Vec<f64> = self.sums.iter().map(|(sum, count)| sum / count).collect();
            take(self.time_sum_s / self.rows, &means);
        }
        *self = Block { number: self.number, ..Block::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn through(times_s: &[f64]) -> (Vec<f64>, u64, Option<Restart>) {
        let (mut clock, mut out) = (LogClock::default(), Vec::new());
        let mut take = |t_s: f64, values: &[f64]| {
            assert_eq!(values, [2.0 * t_s]);
            out.push(t_s);
        };
        let restart = times_s.iter().find_map(|t_s| clock.push(*t_s, &[2.0 * t_s], &mut take).err());
        clock.finish(&mut take);
        (out, clock.strays, restart)
    }

    #[test]
    fn a_single_wrong_time_is_skipped_at_any_place() {
        let good: Vec<f64> = (0..100).map(|row| f64::from(row) / 10.0).collect();
        for wrong in [1e9, -1e9, f64::NAN, 1e300] {
            for at in [0, 50, 100] {
                let mut times_s = good.clone();
                times_s.insert(at, wrong);
                assert_eq!(through(&times_s), (good.clone(), 1, None), "{wrong} at {at}");
            }
        }
        // Back to 0 for one row.
        let mut times_s = good.clone();
        times_s.insert(90, 0.0);
        assert_eq!(through(&times_s), (good, 1, None));
    }

    #[test]
    fn a_clock_that_starts_again_is_reported_with_its_row() {
        let run = || (0..100).map(|row| f64::from(row) / 10.0);
        let times_s: Vec<f64> = run().chain(run()).collect();
        let restart = through(&times_s).2.unwrap();
        assert_eq!(restart, Restart { row: 101, from_s: 9.9, to_s: 0.0 });
    }

    #[test]
    fn pauses_and_rows_a_little_out_of_order_stay() {
        let weekend = [0.0, 0.1, 0.2, 2e5, 2e5 + 0.1, 2e5 + 0.05, 2e5 + 0.2];
        assert_eq!(through(&weekend), (weekend.to_vec(), 0, None));
        // Once a minute, and four minutes back.
        let slow = [0.0, 60.0, 120.0, 180.0, 240.0, 0.0, 60.0, 300.0];
        assert_eq!(through(&slow).2, None);
        assert_eq!(through(&[5.0]).0, [5.0]);
    }

    fn averaged(rate_hz: f64, rows: usize) -> Vec<(f64, Vec<f64>)> {
        let (mut blocks, mut out) = (BlockAverager::default(), Vec::new());
        let mut take = |t_s: f64, values: &[f64]| out.push((t_s, values.to_owned()));
        for row in 0..rows {
            let t_s = row as f64 / rate_hz;
            let slow = if row % 2 == 0 { 1.0 } else { f64::NAN };
            blocks.push(t_s, &[5.0 * t_s, slow], &mut take);
        }
        blocks.finish(&mut take);
        out
    }

    #[test]
    fn a_fast_log_is_averaged_to_ten_hertz() {
        let out = averaged(100.0, 1000);
        assert_eq!(out.len(), 100);
        for (index, (t_s, values)) in out.iter().enumerate() {
            // Ten samples from 0.1 i to 0.1 i + 0.09 s have their mean in the middle; a ramp stays a ramp.
            assert!((t_s - (0.1 * index as f64 + 0.045)).abs() < 1e-9, "{t_s}");
            assert!((values[0] - 5.0 * t_s).abs() < 1e-9 && values[1] == 1.0);
        }
    }

    #[test]
    fn a_log_that_becomes_fast_is_averaged_from_then_on() {
        let (mut blocks, mut out) = (BlockAverager::default(), Vec::new());
        let mut take = |t_s: f64, values: &[f64]| out.push((t_s, values[0]));
        let rest = (0..600).map(f64::from);
        let run = (0..10_000).map(|row| 600.0 + f64::from(row) / 100.0);
        rest.chain(run).for_each(|t_s| blocks.push(t_s, &[5.0 * t_s], &mut take));
        blocks.finish(&mut take);
        assert!(blocks.is_averaging());
        // 600 unchanged rows at rest, 100 s at 10 Hz, and the few rows that showed the change.
        assert!((1600..1640).contains(&out.len()), "{}", out.len());
        assert!(out[..600].iter().enumerate().all(|(row, (t_s, _))| *t_s == row as f64));
        assert!(out.iter().all(|(t_s, value)| (value - 5.0 * t_s).abs() < 1e-9));
    }

    #[test]
    fn a_slow_log_is_not_changed() {
        let out = averaged(10.0, 300);
        assert_eq!(out.len(), 300);
        assert!(
            out.iter()
                .enumerate()
                .all(|(row, (t_s, values))| *t_s == row as f64 / 10.0 && values[0] == 5.0 * t_s)
        );
        assert_eq!(averaged(10.0, 3).len(), 3);
    }
}
