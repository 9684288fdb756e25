//! Samples of one channel in the order of the file, and the series made of them.

use crate::ReadWarning;
use crate::samples::log_clock::{MAX_BACK_INTERVALS, MAX_BACK_S, STRAY_S};
use mapper_core::unit_factors::NS_PER_S;
use mapper_core::{Channel, Series};

/// Maximum step back of a clock due to late messages, ns. Source: the same as for logs.
const MAX_BACK_NS: u64 = (MAX_BACK_S * NS_PER_S) as u64;

/// Maximum number of breaks. Bound: a file whose times go back more often has another fault than a clock that was set.
const MAX_BREAKS: usize = 100;

/// Samples before a break whose shortest interval is that of the channel. Bound: a pause before a break does not hide the rate.
const RECENT_SAMPLES: usize = 6;

/// A place in the file at which the times of a channel go back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ClockBreak {
    pub(crate) position: u64,
    index: usize,
    /// By how much, ns.
    pub(crate) back_ns: u64,
    /// Shortest time between the last samples before it, ns.
    pub(crate) interval_ns: Option<u64>,
}

/// Samples before and after a gap.
pub(crate) type Sides = (Vec<(f64, f64)>, Vec<(f64, f64)>);

#[derive(Debug, Clone, Default)]
pub(crate) struct SeriesBuilder {
    times_ns: Vec<u64>,
    values: Vec<f64>,
    pub(crate) non_numeric_count: u64,
    breaks: Vec<ClockBreak>,
    /// Numbers of the first and the last message.
    positions: (u64, u64),
}

impl SeriesBuilder {
    pub(crate) fn push(&mut self, time_ns: u64, value: f64) {
        self.times_ns.push(time_ns);
        self.values.push(value);
    }

    pub(crate) fn push_at(&mut self, position: u64, time_ns: u64, value: f64) {
        if let Some(last_ns) = self.times_ns.last() {
            let back_ns = last_ns.saturating_sub(time_ns);
            if back_ns > MAX_BACK_NS && self.breaks.len() < MAX_BREAKS {
                let recent = self
                    .times_ns
                    .get(self.times_ns.len().saturating_sub(RECENT_SAMPLES)..)
                    .unwrap_or_default();
                let interval_ns = recent.windows(2).filter_map(|pair| pair[1].checked_sub(pair[0])).min();
                self.breaks.push(ClockBreak { position, index: self.times_ns.len(), back_ns, interval_ns });
            }
        } else {
            self.positions.0 = position;
        }
        self.positions.1 = position;
        self.push(time_ns, value);
    }

    pub(crate) fn breaks(&self) -> &[ClockBreak] {
        &self.breaks
    }

    /// Whether times continue from a break without a jump forward until they have caught up; after a late message they jump.
    pub(crate) fn continues_from(&self, found: &ClockBreak) -> bool {
        let Some(before_ns) = found.index.checked_sub(1).and_then(|at| self.times_ns.get(at)) else {
            return false;
        };
        let limit_ns = MAX_BACK_NS.max(MAX_BACK_INTERVALS as u64 * found.interval_ns.unwrap_or(0));
        let after = self.times_ns.get(found.index..).unwrap_or_default();
        let behind = after.iter().take_while(|time_ns| *time_ns < before_ns).count();
        after
            .iter()
            .take(behind + 1)
            .zip(after.iter().skip(1).take(behind))
            .all(|(time, next)| next.saturating_sub(*time) <= limit_ns)
    }

    /// Numbers of the first and the last message.
    pub(crate) fn positions(&self) -> (u64, u64) {
        self.positions
    }

    pub(crate) fn len(&self) -> usize {
        self.times_ns.len()
    }

    /// Moves the samples from a message on, at which this channel has a break or its first sample.
    pub(crate) fn move_later(&mut self, position: u64, by_ns: u64) {
        let from = match self.breaks.iter().find(|found| found.position >= position) {
            _ if self.positions.0 >= position => 0,
            Some(found) => found.index,
            None => return,
        };
        for time_ns in self.times_ns.iter_mut().skip(from) {
            *time_ns = time_ns.saturating_add(by_ns);
        }
    }

    /// Moves the samples behind the gaps between two times back, until the gaps amount to `by_ns`; returns false, without a change, if they
    /// amount to less.
    pub(crate) fn close_gap(&mut self, from_ns: u64, to_ns: u64, by_ns: u64, tolerance_ns: u64) -> bool {
        let (from_ns, to_ns) = (from_ns.saturating_sub(tolerance_ns), to_ns.saturating_add(tolerance_ns));
        let is_within = |pair: &[u64]| pair[0] >= from_ns && pair[1] <= to_ns;
        // Several gaps count only if no single one suffices: the others may be pauses.
        let largest = self.times_ns.windows(2).filter(|pair| is_within(pair));
        let largest_ns = largest.map(|pair| pair[1].saturating_sub(pair[0])).max().unwrap_or(0);
        let is_single = largest_ns + tolerance_ns >= by_ns;
        let min_gap_ns = if is_single { by_ns.saturating_sub(tolerance_ns) } else { tolerance_ns };
        let mut moved_ns = self.times_ns.clone();
        let (mut closed_ns, mut interval_ns) = (0, None);
        for (pair, moved_ns) in self.times_ns.windows(2).zip(moved_ns.iter_mut().skip(1)) {
            let step_ns = pair[1].saturating_sub(pair[0]);
            // A sample that is missing is not a gap, nor is the interval of a slow channel.
            let gap_ns = step_ns.saturating_sub(interval_ns.unwrap_or(0));
            if gap_ns > min_gap_ns && is_within(pair) {
                closed_ns += gap_ns.min(by_ns - closed_ns);
            } else {
                interval_ns = Some(step_ns);
            }
            *moved_ns = moved_ns.saturating_sub(closed_ns);
        }
        let is_closed = closed_ns + tolerance_ns >= by_ns;
        if is_closed {
            self.times_ns = moved_ns;
        }
        is_closed
    }

    /// Moves all samples from a time on back.
    pub(crate) fn move_earlier(&mut self, from_ns: u64, by_ns: u64) {
        for time_ns in self.times_ns.iter_mut().filter(|time_ns| **time_ns >= from_ns) {
            *time_ns = time_ns.saturating_sub(by_ns);
        }
    }

    pub(crate) fn is_in_order(&self) -> bool {
        self.times_ns.is_sorted()
    }

    pub(crate) fn intervals_s(&self) -> Vec<f64> {
        let steps = self.times_ns.windows(2).filter_map(|pair| pair[1].checked_sub(pair[0]));
        steps.filter(|step| *step > 0).map(|step| step as f64 / NS_PER_S).collect()
    }

    /// Neighbours that are more than this apart, ns.
    pub(crate) fn gaps(&self, limit_s: f64) -> impl Iterator<Item = (u64, u64)> {
        let far = move |pair: &&[u64]| pair[1].saturating_sub(pair[0]) as f64 > limit_s * NS_PER_S;
        self.times_ns.windows(2).filter(far).map(|pair| (pair[0], pair[1]))
    }

    /// The samples next to a gap: times before and after its edges, s, and values. `None` if the channel has no such gap.
    pub(crate) fn sides(&self, from_ns: u64, to_ns: u64, count: usize) -> Option<Sides> {
        let half_ns = from_ns + to_ns.saturating_sub(from_ns) / 2;
        let next = self.times_ns.windows(2).position(|pair| pair[0] < half_ns && half_ns <= pair[1])? + 1;
        let (edge_ns, start_ns) = (*self.times_ns.get(next - 1)?, *self.times_ns.get(next)?);
        let seconds = |time_ns: u64, from_ns: u64| (time_ns as i128 - from_ns as i128) as f64 / NS_PER_S;
        let of = |range: std::ops::Range<usize>, edge_ns: u64| -> Vec<(f64, f64)> {
            range
                .filter_map(|at| Some((seconds(*self.times_ns.get(at)?, edge_ns), *self.values.get(at)?)))
                .collect()
        };
        let end = self.times_ns.len().min(next + count);
        Some((of(next.saturating_sub(count)..next, edge_ns), of(next..end, start_ns)))
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.times_ns.is_empty()
    }

    pub(crate) fn first_time_ns(&self) -> Option<u64> {
        self.times_ns.iter().copied().min()
    }

    /// Removes samples that are more than a day from both neighbours in time; returns their number and the first such time.
    pub(crate) fn drop_strays(&mut self) -> Option<(u64, u64)> {
        let mut sorted = self.times_ns.clone();
        sorted.sort_unstable();
        let far = |a: u64, b: u64| a.abs_diff(b) as f64 > STRAY_S * NS_PER_S;
        let strays: Vec<u64> = sorted
            .iter()
            .enumerate()
            .filter(|(at, time_ns)| {
                let before = at.checked_sub(1).and_then(|before| sorted.get(before));
                let after = sorted.get(at + 1);
                sorted.len() > 2
                    && [before, after].into_iter().flatten().all(|neighbour| far(*neighbour, **time_ns))
            })
            .map(|(_, time_ns)| *time_ns)
            .collect();
        // If most samples are that far apart, this is the channel's sampling interval.
        let first = *strays.first().filter(|_| 2 * strays.len() < sorted.len())?;
        let kept =
            self.times_ns.iter().zip(&self.values).filter(|(time, _)| strays.binary_search(time).is_err());
        (self.times_ns, self.values) = kept.map(|(time_ns, value)| (*time_ns, *value)).unzip();
        Some((strays.len() as u64, first))
    }

    /// The series over run time, strictly increasing; of samples at the same time the first one is kept.
    pub(crate) fn build(self, channel: Channel, zero_ns: u64, warnings: &mut Vec<ReadWarning>) -> Series {
        if self.non_numeric_count > 0 {
            let channels = vec![channel];
            ReadWarning::NotANumber { channels, count: self.non_numeric_count }.add_to(warnings);
        }
        let (times_ns, mut values) = if self.times_ns.is_sorted_by(|a, b| a < b) {
            (self.times_ns, self.values)
        } else {
            let reordered = self.times_ns.windows(2).filter(|pair| pair[1] < pair[0]).count();
            let mut samples: Vec<(u64, f64)> = self.times_ns.into_iter().zip(self.values).collect();
            let before = samples.len();
            samples.sort_by_key(|(time_ns, _)| *time_ns);
            samples.dedup_by_key(|(time_ns, _)| *time_ns);
            let repeated = before - samples.len();
            ReadWarning::OutOfOrder { channels: vec![channel], reordered, repeated }.add_to(warnings);
            samples.into_iter().unzip()
        };
        let mut t_s: Vec<f64> = times_ns.into_iter().map(|time_ns| run_time_s(time_ns, zero_ns)).collect();
        // What reading had reserved for further samples.
        t_s.shrink_to_fit();
        values.shrink_to_fit();
        Series { t_s, values }
    }
}

/// Run time of a log time. Exact to the nanosecond for runs up to 104 days.
pub(crate) fn run_time_s(time_ns: u64, zero_ns: u64) -> f64 {
    (time_ns as i128 - zero_ns as i128) as f64 / NS_PER_S
}
