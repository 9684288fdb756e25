//! Queue of samples that have arrived but have not been polled.

use crate::protocol::InvalidData;
use mapper_core::{Channel, ChannelColumn, Event, EventKind, SampleBatch};
use std::collections::VecDeque;

/// Maximum number of queued values over all columns, at 8 bytes each, including names and texts: three hours of 19 channels at 10 Hz, 32 MB.
const MAX_VALUES: usize = 4_000_000;
/// Tolerance for due samples, s: the requested time is a sum of periods, the sample's time a multiple.
pub(crate) const ROUNDING_S: f64 = 1e-7;
const MAX_EVENTS: usize = 10_000;
/// Number of events above which a driver's notes are dropped.
const MAX_NOTES: usize = 100;

/// Checked batches in order of arrival, without gaps.
#[derive(Default)]
pub(crate) struct SampleQueue {
    batches: VecDeque<SampleBatch>,
    events: Vec<Event>,
    /// Index of the next sample to arrive and of the next sample to return.
    expected: u64,
    next: u64,
    last_s: Option<f64>,
    /// Time of the last returned sample, s.
    returned_until_s: Option<f64>,
    values: usize,
}

impl SampleQueue {
    /// Adds a batch.
    ///
    /// # Errors
    /// [`InvalidData`] if the samples do not follow the previous ones, or are too many.
    pub(crate) fn push(&mut self, mut batch: SampleBatch) -> Result<(), InvalidData> {
        // An event from another clock might never be due. That must not happen to a trip of the rig.
        let latest_s = batch.t_s.last().copied().or(self.last_s).unwrap_or(0.0);
        for event in &mut batch.events {
            event.t_s = if event.t_s.is_finite() { event.t_s.min(latest_s) } else { latest_s };
        }
        self.events.append(&mut batch.events);
        let text: usize = self.events.iter().map(|event| event.message.len()).sum();
        if self.events.len() > MAX_EVENTS || self.values + text / 8 > MAX_VALUES {
            return Err(InvalidData::TooMany);
        }
        let Some(first_s) = batch.t_s.first().copied() else { return Ok(()) };
        if batch.first_sequence != self.expected {
            return Err(InvalidData::Sequence { expected: self.expected, found: batch.first_sequence });
        }
        if let Some(before_s) = self.last_s.filter(|last_s| first_s <= *last_s) {
            return Err(InvalidData::Time { before_s, t_s: first_s });
        }
        self.values += batch.t_s.len() * values_per_sample(&batch) + name_values(&batch);
        if self.values > MAX_VALUES {
            return Err(InvalidData::TooMany);
        }
        self.expected += batch.t_s.len() as u64;
        self.last_s = batch.t_s.last().copied();
        self.batches.push_back(batch);
        Ok(())
    }

    /// Adds a note at this run time, s, to the next batch; only a few are kept.
    pub(crate) fn note(&mut self, t_s: f64, text: &str) {
        if self.events.len() < MAX_NOTES {
            self.events.push(Event { t_s, kind: EventKind::Note, message: text.to_owned() });
        }
    }

    /// Whether a sample at or after `t_s` has arrived.
    pub(crate) fn has_reached(&self, t_s: f64) -> bool {
        self.last_s.is_some_and(|last_s| last_s >= t_s)
    }

    /// Returns all samples up to `until_s` plus `rounding_s`, with a column for each of `channels`: NaN without a reading.
    pub(crate) fn take(&mut self, until_s: f64, rounding_s: f64, channels: &[Channel]) -> SampleBatch {
        let mut merged = SampleBatch {
            first_sequence: self.next,
            columns: channels.iter().map(|c| ChannelColumn { channel: *c, values: Vec::new() }).collect(),
            ..SampleBatch::default()
        };
        while let Some(mut batch) = self.batches.pop_front() {
            let mut due = batch.t_s.partition_point(|t_s| *t_s <= until_s);
            let before_s =
                due.checked_sub(1).and_then(|last| batch.t_s.get(last).copied()).or(self.returned_until_s);
            if let Some(t_s) = batch.t_s.get_mut(due)
                && *t_s <= until_s + rounding_s
                && before_s.is_none_or(|before_s| before_s < until_s)
            {
                (*t_s, due) = (until_s, due + 1);
            }
            if due > 0 {
                self.returned_until_s = batch.t_s.get(due - 1).copied();
            }
            self.values = self.values.saturating_sub(due * values_per_sample(&batch));
            let later = batch.split_off(due);
            if later.t_s.is_empty() {
                self.values = self.values.saturating_sub(name_values(&batch));
            }
            merged.append(batch);
            if !later.t_s.is_empty() {
                self.batches.push_front(later);
                break;
            }
        }
        merged.columns.retain(|column| channels.contains(&column.channel));
        self.next += merged.t_s.len() as u64;
        let (now, later) =
            std::mem::take(&mut self.events).into_iter().partition(|e: &Event| e.t_s <= until_s);
        (merged.events, self.events) = (now, later);
        merged
    }
}

fn values_per_sample(batch: &SampleBatch) -> usize {
    1 + batch.columns.len() + batch.elements.len() + batch.truth.len() + 2 * batch.provenance.len()
}

/// Memory of the names in a batch, in values.
fn name_values(batch: &SampleBatch) -> usize {
    batch.truth.iter().map(|column| column.name.len() + column.unit.len()).sum::<usize>() / 8
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Provenance, Quality};

    fn batch(first_sequence: u64, t_s: &[f64], channels: &[Channel]) -> SampleBatch {
        let column = |channel: &Channel| ChannelColumn { channel: *channel, values: t_s.to_vec() };
        SampleBatch {
            first_sequence,
            t_s: t_s.to_vec(),
            columns: channels.iter().map(column).collect(),
            ..SampleBatch::default()
        }
    }

    #[test]
    fn repeated_missing_and_backward_batches_are_refused_and_valid_ones_stay() {
        use Channel::{T1, T2};
        let mut pending = SampleQueue::default();
        pending.push(batch(0, &[0.0, 0.1], &[T1, T2])).unwrap();
        let again = pending.push(batch(0, &[0.0, 0.1], &[T1, T2]));
        assert_eq!(again, Err(InvalidData::Sequence { expected: 2, found: 0 }));
        let missing = pending.push(batch(3, &[0.3], &[T1, T2]));
        assert_eq!(missing, Err(InvalidData::Sequence { expected: 2, found: 3 }));
        let backward = pending.push(batch(2, &[0.05], &[T1, T2]));
        assert_eq!(backward, Err(InvalidData::Time { before_s: 0.1, t_s: 0.05 }));
        let mut worse = batch(2, &[0.2, 0.3], &[T1]);
        worse.provenance =
            vec![Provenance { channel: T1, source_t_s: vec![0.1, 0.1], quality: vec![Quality::Bad; 2] }];
        pending.push(worse).unwrap();
        assert!(pending.has_reached(0.3) && !pending.has_reached(0.31));
        let merged = pending.take(0.25, 0.0, &[T1, T2]);
        assert_eq!((merged.first_sequence, &merged.t_s[..]), (0, &[0.0, 0.1, 0.2][..]));
        assert_eq!(merged.column(T1), Some(&[0.0, 0.1, 0.2][..]));
        assert!(merged.column(T2).unwrap()[2].is_nan());
        let from = merged.provenance_of(T1).unwrap();
        assert_eq!(from.source_t_s, [0.0, 0.1, 0.1]);
        assert_eq!(from.quality, [Quality::Good, Quality::Good, Quality::Bad]);
        let rest = pending.take(9.0, 0.0, &[T1, T2]);
        assert_eq!((rest.first_sequence, &rest.t_s[..]), (3, &[0.3][..]));
    }

    /// Seven times 0.1 added up is slightly less than 0.7. Without the tolerance, a sample would reach its guard one poll later.
    #[test]
    fn a_sample_is_not_late_by_rounding() {
        let mut pending = SampleQueue::default();
        let (sum_s, multiple_s) = ([0.1; 7].iter().sum::<f64>(), 7.0 * 0.1);
        assert!(sum_s < multiple_s);
        pending.push(batch(0, &[multiple_s], &[Channel::T1])).unwrap();
        assert_eq!(pending.take(sum_s, ROUNDING_S, &[Channel::T1]).t_s, [sum_s]);
        pending.push(batch(1, &[multiple_s + 1e-3], &[Channel::T1])).unwrap();
        assert!(pending.take(multiple_s, ROUNDING_S, &[Channel::T1]).t_s.is_empty());
    }

    #[test]
    fn an_event_with_an_unsynchronised_time_is_returned_with_its_samples() {
        let mut pending = SampleQueue::default();
        let tripped = Event { t_s: 1.8e9, kind: EventKind::RigTripped, message: "overspeed".to_owned() };
        let with_it = SampleBatch { events: vec![tripped], ..batch(0, &[0.0, 0.1], &[Channel::T1]) };
        pending.push(with_it).unwrap();
        assert_eq!(pending.take(0.1, 0.0, &[Channel::T1]).events[0].t_s, 0.1);
    }

    #[test]
    fn texts_and_names_count_towards_the_limit() {
        let mut pending = SampleQueue::default();
        let long = Event { t_s: 0.0, kind: EventKind::Note, message: "x".repeat(1 << 20) };
        let flood = (0..100).try_for_each(|_| {
            pending.push(SampleBatch { events: vec![long.clone()], ..SampleBatch::default() })
        });
        assert_eq!(flood, Err(InvalidData::TooMany));
    }

    #[test]
    fn the_queue_is_limited() {
        let mut pending = SampleQueue::default();
        let t_s: Vec<f64> = (0..100_000).map(f64::from).collect();
        let flood = (0..50).try_for_each(|i| {
            let later: Vec<f64> = t_s.iter().map(|t_s| t_s + f64::from(i) * 1e5).collect();
            pending.push(batch(i as u64 * 100_000, &later, &[Channel::T1]))
        });
        assert_eq!(flood, Err(InvalidData::TooMany));
    }
}
