//! The guard for the rig itself: a reported trip, or a shaft that is no longer driven.

use crate::guards::guard::{CommandedState, Guard};
use mapper_core::{Channel, EventKind, GuardName, Reaction, SampleBatch, Trip};

/// Time after the start of a step in which the shaft may accelerate, s.
const START_UP_S: f64 = 30.0;
/// A shaft below this share of its target speed is not driven.
const MIN_DRIVEN_RATIO: f64 = 0.5;
/// Duration of the low speed before the guard trips, s.
const MAX_LOW_SPEED_S: f64 = 5.0;

/// Trips if the rig reports its own trip, or if the shaft speed collapses.
#[derive(Debug, Clone, Default)]
pub struct RigWatch {
    slow_since_s: Option<f64>,
    tripped: bool,
}

impl RigWatch {
    fn trip(&mut self, t_s: f64, reason: String) -> Option<Trip> {
        (!std::mem::replace(&mut self.tripped, true)).then_some(Trip {
            t_s,
            guard: GuardName::Rig,
            reaction: Reaction::Latch,
            reason,
        })
    }
}

impl Guard for RigWatch {
    fn check(&mut self, batch: &SampleBatch, _: f64, state: &CommandedState) -> Option<Trip> {
        if let Some(event) = batch.events.iter().find(|event| event.kind == EventKind::RigTripped) {
            return self.trip(event.t_s, event.message.clone());
        }
        let (Some(aim), Some(since_s)) = (state.aim.filter(|_| state.running), state.step_since_s) else {
            self.slow_since_s = None;
            return None;
        };
        let speeds = batch.column(Channel::ShaftSpeed)?;
        for (t_s, speed_rpm) in batch.t_s.iter().zip(speeds).filter(|(t_s, _)| **t_s - since_s > START_UP_S) {
            if *speed_rpm >= MIN_DRIVEN_RATIO * aim.speed_rpm {
                self.slow_since_s = None;
            } else if speed_rpm.is_finite() {
                let slow_since_s = *self.slow_since_s.get_or_insert(*t_s);
                if t_s - slow_since_s > MAX_LOW_SPEED_S {
                    let reason = format!(
                        "the shaft turns at {:.2} krpm instead of {:.2} krpm since {slow_since_s:.1} s: the rig no longer drives it",
                        speed_rpm / 1e3,
                        aim.speed_rpm / 1e3
                    );
                    return self.trip(*t_s, reason);
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{ChannelColumn, Event, OperatingPoint};

    #[test]
    fn a_reported_trip_and_a_stopped_shaft_trip_once_and_latch() {
        let aim = Some(OperatingPoint { speed_rpm: 1e5, valve_opening_ratio: 0.7 });
        let state = CommandedState { running: true, step_since_s: Some(0.0), aim, jumped_s: None };
        let speeds = |from_s: f64, rpm: f64| {
            let t_s: Vec<f64> = (0..100).map(|i| from_s + 0.1 * f64::from(i)).collect();
            let values = vec![rpm; 100];
            let columns = vec![ChannelColumn { channel: Channel::ShaftSpeed, values }];
            SampleBatch { t_s, columns, ..SampleBatch::default() }
        };
        let mut guard = RigWatch::default();
        assert_eq!(guard.check(&speeds(0.0, 30.0), 10.0, &state), None, "the shaft still accelerates");
        assert_eq!(
            guard.check(&speeds(40.0, 60e3), 50.0, &state),
            None,
            "another guard checks a small speed error"
        );
        let trip = guard.check(&speeds(50.0, 30.0), 60.0, &state).unwrap();
        assert_eq!(trip.reaction, Reaction::Latch);
        assert!((55.0..55.3).contains(&trip.t_s), "{}", trip.t_s);
        assert_eq!(guard.check(&speeds(60.0, 30.0), 70.0, &state), None);
        let mut tripped = speeds(0.0, 1e5);
        let message = "overspeed".to_owned();
        tripped.events.push(Event { t_s: 3.0, kind: EventKind::RigTripped, message });
        let trip = RigWatch::default().check(&tripped, 10.0, &state).unwrap();
        assert_eq!((trip.t_s, trip.reason.as_str()), (3.0, "overspeed"));
    }
}
