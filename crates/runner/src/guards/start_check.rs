//! Checks the first seconds of a run, before the machine is driven far: every channel alive, in range, and on time.

use crate::guards::guard::{CommandedState, Guard};
use mapper_core::{Channel, GuardName, Reaction, SampleBatch, Trip, measurable, with_unit};

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
    use mapper_core::{ChannelColumn, Provenance, Quality};

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
