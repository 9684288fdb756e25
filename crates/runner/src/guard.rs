//! What ends a run before harm is done: each trip is an object beside the runner, not an `if` inside it.

use mapper_core::{Channel, EventKind, SampleBatch, readable};

/// A reason to bring the rig into its safe state.
#[derive(Debug, Clone, PartialEq)]
pub struct Trip {
    /// Run time, s.
    pub t_s: f64,
    /// One sentence with values and units.
    pub reason: String,
}

/// Looks at every batch and may trip.
pub trait Guard: Send {
    /// The reason to stop, if this batch gives one.
    fn check(&mut self, batch: &SampleBatch) -> Option<Trip>;
}

/// Trips when a channel stays above its limit.
#[derive(Debug, Clone)]
pub struct LimitGuard {
    channel: Channel,
    /// Highest allowed value, unit of the channel.
    limit: f64,
    /// Samples in a row above the limit that make a trip: one noisy sample is none.
    patience_samples: u32,
    above: u32,
}

impl LimitGuard {
    /// A guard that trips at the third sample in a row above `limit` (unit of the channel).
    pub fn new(channel: Channel, limit: f64) -> Self {
        LimitGuard { channel, limit, patience_samples: 3, above: 0 }
    }
}

impl Guard for LimitGuard {
    fn check(&mut self, batch: &SampleBatch) -> Option<Trip> {
        let values = batch.column(self.channel)?;
        for (t_s, value) in batch.t_s.iter().zip(values) {
            self.above = if *value > self.limit { self.above + 1 } else { 0 };
            if self.above >= self.patience_samples {
                let (channel, unit, limit) = (self.channel, self.channel.unit(), self.limit);
                return Some(Trip {
                    t_s: *t_s,
                    reason: format!(
                        "{} ({channel}) is {}, above its limit of {}",
                        channel.info().description,
                        readable(*value, unit),
                        readable(limit, unit)
                    ),
                });
            }
        }
        None
    }
}

/// Trips when the compressor stays in surge.
#[derive(Debug, Clone)]
pub struct SurgeGuard {
    allowed_s: f64,
    since_s: Option<f64>,
}

impl SurgeGuard {
    /// A guard that allows `allowed_s` of surge at a time: a jump may touch the line, a point may not stay there.
    pub fn new(allowed_s: f64) -> Self {
        SurgeGuard { allowed_s, since_s: None }
    }
}

impl Guard for SurgeGuard {
    fn check(&mut self, batch: &SampleBatch) -> Option<Trip> {
        for event in &batch.events {
            match event.kind {
                EventKind::SurgeEntered => self.since_s = Some(event.t_s),
                EventKind::SurgeLeft => self.since_s = None,
                _ => {}
            }
        }
        let (since_s, now_s) = (self.since_s?, *batch.t_s.last()?);
        (now_s - since_s > self.allowed_s).then(|| Trip {
            t_s: now_s,
            reason: format!(
                "the compressor has been in surge since {since_s:.1} s, longer than the {:.1} s allowed",
                self.allowed_s
            ),
        })
    }
}

/// Trips when samples are missing or stale: what is not seen cannot be guarded.
#[derive(Debug, Clone)]
pub struct SilenceGuard {
    watched: Vec<Channel>,
    allowed_s: f64,
    next_sequence: Option<u64>,
    /// Time of the last finite value of each watched channel, s.
    last_seen_s: Vec<f64>,
}

impl SilenceGuard {
    /// A guard over channels that must keep giving values, with gaps of at most `allowed_s`.
    pub fn new(watched: Vec<Channel>, allowed_s: f64) -> Self {
        let last_seen_s = vec![f64::NEG_INFINITY; watched.len()];
        SilenceGuard { watched, allowed_s, next_sequence: None, last_seen_s }
    }
}

impl Guard for SilenceGuard {
    fn check(&mut self, batch: &SampleBatch) -> Option<Trip> {
        let now_s = *batch.t_s.last()?;
        if let Some(expected) = self.next_sequence
            && batch.first_sequence != expected
        {
            let lost = batch.first_sequence.wrapping_sub(expected);
            return Some(Trip {
                t_s: now_s,
                reason: format!("{lost} samples were lost before {now_s:.1} s"),
            });
        }
        self.next_sequence = Some(batch.first_sequence + batch.t_s.len() as u64);
        for (channel, last_seen_s) in self.watched.iter().zip(&mut self.last_seen_s) {
            if last_seen_s.is_infinite() {
                // Silence counts from the first batch on.
                *last_seen_s = batch.t_s.first().copied().unwrap_or(now_s);
            }
            if let Some(values) = batch.column(*channel) {
                for (t_s, _) in batch.t_s.iter().zip(values).filter(|(_, value)| value.is_finite()) {
                    *last_seen_s = *t_s;
                }
            }
            if now_s - *last_seen_s > self.allowed_s {
                return Some(Trip {
                    t_s: now_s,
                    reason: format!(
                        "{} ({channel}) has given no value since {last_seen_s:.1} s",
                        channel.info().description
                    ),
                });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{ChannelColumn, Event};

    fn batch(first_sequence: u64, values: &[f64]) -> SampleBatch {
        SampleBatch {
            first_sequence,
            t_s: (0..values.len()).map(|i| (first_sequence + i as u64) as f64 * 0.1).collect(),
            columns: vec![ChannelColumn { channel: Channel::T2, values: values.to_vec() }],
            ..SampleBatch::default()
        }
    }

    #[test]
    fn one_noisy_sample_does_not_trip_but_three_in_a_row_across_batches_do() {
        let mut guard = LimitGuard::new(Channel::T2, 400.0);
        assert_eq!(guard.check(&batch(0, &[401.0, 399.0, 401.0, 401.0])), None);
        let trip = guard.check(&batch(4, &[401.5])).unwrap();
        assert!(trip.reason.contains("401.5 K") && trip.reason.contains("400.0 K"), "{}", trip.reason);
    }

    #[test]
    fn short_surge_is_allowed_and_long_surge_is_not() {
        let mut guard = SurgeGuard::new(1.0);
        let mut first = batch(0, &[0.0; 5]);
        first.events.push(Event { t_s: 0.2, kind: EventKind::SurgeEntered, message: String::new() });
        assert_eq!(guard.check(&first), None);
        assert!(guard.check(&batch(5, &[0.0; 10])).is_some());
        let mut left = batch(15, &[0.0; 10]);
        left.events.push(Event { t_s: 1.6, kind: EventKind::SurgeLeft, message: String::new() });
        assert_eq!(guard.check(&left), None);
    }

    #[test]
    fn lost_and_silent_samples_trip() {
        let mut guard = SilenceGuard::new(vec![Channel::T2], 0.5);
        assert_eq!(guard.check(&batch(0, &[1.0; 5])), None);
        assert!(guard.check(&batch(7, &[1.0; 5])).unwrap().reason.contains("2 samples"));
        let mut guard = SilenceGuard::new(vec![Channel::T2], 0.5);
        assert_eq!(guard.check(&batch(0, &[1.0; 5])), None);
        assert!(guard.check(&batch(5, &[f64::NAN; 10])).unwrap().reason.contains("no value since 0.4 s"));
        let mut guard = SilenceGuard::new(vec![Channel::P2], 0.5);
        assert!(guard.check(&batch(0, &[1.0; 10])).is_some());
    }
}
