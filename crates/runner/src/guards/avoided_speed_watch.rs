//! The guard of the speeds to avoid: it notes a crossing that takes longer than declared, and skips a step in which the shaft stays inside.

use crate::guards::guard::{CommandedState, Guard};
use mapper_core::{
    AvoidedCrossing, AvoidedSpeeds, AvoidedTime, Channel, GuardName, Reaction, SampleBatch, Trip,
};

/// Multiple of the longest time after which a step is skipped. Judgement: a slow crossing ends before, and going back would cross again.
const STAYS_MULTIPLE: f64 = 3.0;

/// Trips twice at most in each step: when the longest time has passed, and when the shaft stays.
#[derive(Debug, Clone)]
pub struct AvoidedSpeedWatch {
    avoid: AvoidedSpeeds,
    time: AvoidedTime,
    /// Start of the step whose time is counted, s.
    since_s: Option<f64>,
    /// The reaction that was last required in it.
    required: Option<Reaction>,
}

impl AvoidedSpeedWatch {
    /// Creates a guard of these speeds.
    pub fn new(avoid: AvoidedSpeeds) -> Self {
        AvoidedSpeedWatch { avoid, time: AvoidedTime::default(), since_s: None, required: None }
    }
}

impl Guard for AvoidedSpeedWatch {
    fn check(&mut self, batch: &SampleBatch, now_s: f64, state: &CommandedState) -> Option<Trip> {
        if self.since_s != state.step_since_s {
            *self = AvoidedSpeedWatch { since_s: state.step_since_s, ..AvoidedSpeedWatch::new(self.avoid) };
        }
        self.time.add_all(&self.avoid, (&batch.t_s, batch.column(Channel::ShaftSpeed)?));
        let AvoidedCrossing { range, inside_s } = self.time.slowest(&self.avoid)?;
        let reaction = match inside_s / range.longest_s {
            ratio if ratio > STAYS_MULTIPLE && state.step_since_s.is_some() => Reaction::SkipStep,
            ratio if ratio > 1.0 => Reaction::Note,
            _ => return None,
        };
        let is_new = self.required.is_none_or(|required| required < reaction);
        self.required = self.required.max(Some(reaction));
        is_new.then(|| Trip {
            t_s: now_s,
            guard: GuardName::AvoidedSpeed,
            reaction,
            reason: format!(
                "the shaft was within the speeds to avoid, {:.2} to {:.2} krpm, for {inside_s:.1} s; at most {:.1} s are allowed",
                range.from_rpm / 1e3,
                range.to_rpm / 1e3,
                range.longest_s
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{AvoidedRange, ChannelColumn};

    fn batch(from_s: f64, speeds: &[f64]) -> SampleBatch {
        let t_s = (0..speeds.len()).map(|i| from_s + i as f64).collect();
        let columns = vec![ChannelColumn { channel: Channel::ShaftSpeed, values: speeds.to_vec() }];
        SampleBatch { t_s, columns, ..SampleBatch::default() }
    }

    #[test]
    fn a_slow_crossing_is_noted_once_and_a_stay_skips_the_step() {
        let range = AvoidedRange { from_rpm: 88e3, to_rpm: 92e3, longest_s: 2.0 };
        let mut guard = AvoidedSpeedWatch::new(vec![range].into());
        let step = |start_s| CommandedState { step_since_s: Some(start_s), ..CommandedState::default() };
        let mut reaction = |from_s: f64, speeds: &[f64], start_s: f64| {
            guard.check(&batch(from_s, speeds), from_s, &step(start_s)).map(|trip| trip.reaction)
        };
        assert_eq!(reaction(0.0, &[80e3, 90e3, 100e3], 0.0), None);
        assert_eq!(reaction(3.0, &[90e3; 3], 0.0), Some(Reaction::Note));
        assert_eq!(reaction(6.0, &[90e3; 2], 0.0), None, "noted already");
        assert_eq!(reaction(8.0, &[90e3; 3], 0.0), Some(Reaction::SkipStep));
        assert_eq!(reaction(20.0, &[90e3; 2], 20.0), None, "a new step counts from its start");
    }
}
