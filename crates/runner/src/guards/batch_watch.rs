//! The guard for the sample stream itself: lost, repeated, disordered or impossible samples.

use crate::guards::guard::{CommandedState, Guard};
use mapper_core::{GuardName, Reaction, SampleBatch, Trip};

/// How far a sample may lie beyond the requested time, s: the clocks of rig and program differ.
const MAX_AHEAD_S: f64 = 1.0;

/// Trips at the first invalid batch.
#[derive(Debug, Clone, Default)]
pub struct BatchWatch {
    next_sequence: Option<u64>,
    last_s: Option<f64>,
    tripped: bool,
}

impl BatchWatch {
    /// Describes the fault of a batch.
    fn find_fault(&mut self, batch: &SampleBatch, now_s: f64) -> Option<String> {
        let samples = batch.t_s.len();
        if let Some(column) = batch.columns.iter().find(|column| column.values.len() != samples) {
            let count = column.values.len();
            return Some(format!("{} has {count} values for {samples} times", column.channel));
        }
        let (first, next) = (batch.first_sequence, self.next_sequence);
        if samples > 0 {
            match next {
                Some(expected) if first > expected => {
                    return Some(format!("{} samples were lost before {now_s:.1} s", first - expected));
                }
                Some(expected) if first < expected => {
                    return Some(format!("{} samples were sent twice at {now_s:.1} s", expected - first));
                }
                _ => {}
            }
            self.next_sequence = Some(first.saturating_add(samples as u64));
        }
        for t_s in &batch.t_s {
            if !t_s.is_finite() || self.last_s.is_some_and(|last_s| *t_s <= last_s) {
                let last_s = self.last_s.unwrap_or(f64::NAN);
                return Some(format!(
                    "time runs backward: a sample at {t_s:.3} s after one at {last_s:.3} s"
                ));
            }
            if *t_s > now_s + MAX_AHEAD_S {
                return Some(format!("a sample at {t_s:.1} s lies beyond the requested time, {now_s:.1} s"));
            }
            self.last_s = Some(*t_s);
        }
        None
    }
}

impl Guard for BatchWatch {
    fn check(&mut self, batch: &SampleBatch, now_s: f64, _: &CommandedState) -> Option<Trip> {
        let reason = self.find_fault(batch, now_s).filter(|_| !self.tripped)?;
        self.tripped = true;
        Some(Trip { t_s: now_s, guard: GuardName::Signals, reaction: Reaction::Safe, reason })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Channel, ChannelColumn};

    #[test]
    fn lost_repeated_disordered_and_incomplete_batches_trip() {
        let at = |first_sequence: u64, t_s: &[f64], values: usize| SampleBatch {
            first_sequence,
            t_s: t_s.to_vec(),
            columns: vec![ChannelColumn { channel: Channel::T2, values: vec![300.0; values] }],
            ..SampleBatch::default()
        };
        for (batch, message) in [
            (at(5, &[0.5, 0.6], 2), "3 samples were lost"),
            (at(1, &[0.1, 0.2], 2), "1 samples were sent twice"),
            (at(2, &[0.3, 0.2], 2), "time runs backward"),
            (at(2, &[0.05, 0.3], 2), "time runs backward"),
            (at(2, &[0.3, f64::NAN], 2), "time runs backward"),
            (at(2, &[0.3, 9.0], 2), "beyond the requested time"),
            (at(2, &[0.3, 0.4], 3), "3 values for 2 times"),
        ] {
            let mut guard = BatchWatch::default();
            assert_eq!(guard.check(&at(0, &[0.0, 0.1], 2), 0.1, &CommandedState::default()), None);
            // An empty batch is left to the age guards.
            assert_eq!(guard.check(&SampleBatch::default(), 0.2, &CommandedState::default()), None);
            let trip = guard.check(&batch, 0.6, &CommandedState::default()).unwrap();
            assert!(trip.reason.contains(message), "{}", trip.reason);
        }
        let mut guard = BatchWatch::default();
        assert_eq!(guard.check(&at(0, &[0.0, 0.1], 2), 0.1, &CommandedState::default()), None);
        assert_eq!(guard.check(&at(2, &[0.2], 1), 0.2, &CommandedState::default()), None);
    }
}
