//! Guards of the data that a rig sends: order and time of samples, its own trips, and every channel alive in the first seconds.

use crate::guards::guard::{CommandedState, Guard};
use mapper_core::{Channel, EventKind, GuardName, Reaction, SampleBatch, Trip, measurable, with_unit};

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

/// Duration of the check, s.
const CHECK_DURATION_S: f64 = 5.0;
/// Allowed offset of a source's clock, s.
const MAX_CLOCK_OFFSET_S: f64 = 1.0;
/// Channels that identification requires: a fault in one ends the run, faults in others are noted.
pub const REQUIRED_CHANNELS: [Channel; 7] = [
    Channel::ShaftSpeed,
    Channel::CompressorFlow,
    Channel::P1,
    Channel::T1,
    Channel::P2,
    Channel::T2,
    Channel::Tc,
];

/// Trips once, after the first seconds, if a channel does not behave like its sensor.
#[derive(Debug, Clone)]
pub struct StartCheck {
    channels: Vec<Channel>,
    /// Last finite reading of each channel.
    seen: Vec<Option<f64>>,
    clock_off_s: f64,
    over: bool,
}

impl StartCheck {
    /// Creates a check of these channels.
    pub fn new(channels: Vec<Channel>) -> Self {
        let seen = vec![None; channels.len()];
        StartCheck { channels, seen, clock_off_s: 0.0, over: false }
    }

    /// Describes the faults, and whether they affect a required channel.
    fn list_faults(&self) -> Vec<(bool, String)> {
        let mut faults: Vec<(bool, String)> = Vec::new();
        for (channel, seen) in self.channels.iter().zip(&self.seen) {
            let needed = REQUIRED_CHANNELS.contains(channel);
            let range = measurable(channel.info().dimension);
            match seen {
                None => faults.push((needed, format!("{channel} gives no reading"))),
                Some(value) if !range.contains(value) => {
                    let (low, high, unit) = (range.start(), range.end(), channel.unit());
                    let message = format!(
                        "{channel} reads {}, where a sensor reads {} to {}",
                        with_unit(format_bound(*value), unit),
                        format_bound(*low),
                        with_unit(format_bound(*high), unit)
                    );
                    faults.push((needed, message));
                }
                Some(_) => {}
            }
        }
        if self.clock_off_s > MAX_CLOCK_OFFSET_S {
            faults.push((true, format!("the source's clock is off by {:.1} s", self.clock_off_s)));
        }
        faults
    }
}

/// Formats a value with enough digits to distinguish it from the bounds of its range.
fn format_bound(value: f64) -> String {
    match value.abs() {
        size if size >= 1e7 => format!("{value:.2e}"),
        size if size >= 10.0 => format!("{value:.0}"),
        _ => format!("{value}"),
    }
}

impl Guard for StartCheck {
    fn check(&mut self, batch: &SampleBatch, now_s: f64, _: &CommandedState) -> Option<Trip> {
        if self.over {
            return None;
        }
        for (channel, seen) in self.channels.iter().zip(&mut self.seen) {
            let last = batch.column(*channel).and_then(|values| values.iter().rev().find(|v| v.is_finite()));
            *seen = last.copied().or(*seen);
        }
        for from in &batch.provenance {
            for (source_s, t_s) in from.source_t_s.iter().zip(&batch.t_s) {
                self.clock_off_s = self.clock_off_s.max((source_s - t_s).abs());
            }
        }
        if now_s < CHECK_DURATION_S {
            return None;
        }
        self.over = true;
        let faults = self.list_faults();
        let needed = faults.iter().any(|(needed, _)| *needed);
        let message: Vec<&str> = faults.iter().map(|(_, message)| message.as_str()).collect();
        (!message.is_empty()).then(|| Trip {
            t_s: now_s,
            guard: GuardName::Signals,
            reaction: if needed { Reaction::Safe } else { Reaction::Note },
            reason: format!("at the start {}", message.join(", ")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Channel, ChannelColumn, Event, OperatingPoint, Provenance, Quality};

    #[test]
    fn a_reported_trip_and_a_stopped_shaft_trip_once_and_latch() {
        let aim = Some(OperatingPoint { speed_rpm: 1e5, valve_opening_ratio: 0.7 });
        let state =
            CommandedState { running: true, step_since_s: Some(0.0), aim, ..CommandedState::default() };
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

    #[test]
    fn missing_implausible_and_old_readings_are_detected_at_the_start() {
        let look = |t2: f64, t4: f64, source_s: f64| {
            let column = |channel, value| ChannelColumn { channel, values: vec![value; 60] };
            let t_s: Vec<f64> = (0..60).map(|i| 0.1 * f64::from(i)).collect();
            let provenance = Provenance {
                channel: Channel::T2,
                source_t_s: t_s.iter().map(|t| t + source_s).collect(),
                quality: vec![Quality::Good; 60],
            };
            let batch = SampleBatch {
                columns: vec![column(Channel::T2, t2), column(Channel::T4, t4)],
                provenance: vec![provenance],
                t_s,
                ..SampleBatch::default()
            };
            StartCheck::new(vec![Channel::T2, Channel::T4]).check(&batch, 5.9, &CommandedState::default())
        };
        assert_eq!(look(300.0, 600.0, 0.0), None);
        let trip = look(f64::NAN, 600.0, 0.0).unwrap();
        assert!(trip.reason.contains("T2 gives no reading") && trip.reaction == Reaction::Safe);
        assert!(look(3000.0, 600.0, 0.0).unwrap().reason.contains("T2 reads 3000 K"));
        assert_eq!(look(300.0, f64::NAN, 0.0).unwrap().reaction, Reaction::Note);
        assert!(look(300.0, 600.0, 7.0).unwrap().reason.contains("clock is off by 7.0 s"));
    }
}
