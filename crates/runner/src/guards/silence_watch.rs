//! Frozen readings, and the guard for channels that no other guard checks, of the rig and of auxiliary instruments: silent and frozen ones.

use crate::guards::guard::{CommandedState, Guard};
use mapper_core::{Channel, FrozenLimit, GuardName, Quality, Reaction, SampleBatch, Trip, readable};

/// The last readings of a channel that may freeze.
#[derive(Debug, Clone)]
pub(crate) struct FrozenReading {
    limit: FrozenLimit,
    /// Start of the period of constant readings, s, and their value.
    constant_since: Option<(f64, f64)>,
}

impl FrozenReading {
    pub(crate) fn new(limit: FrozenLimit) -> Self {
        FrozenReading { limit, constant_since: None }
    }

    /// Takes a reading. Describes the fault if the channel has not moved since before the last jump.
    pub(crate) fn check(
        &mut self,
        t_s: f64,
        value: f64,
        channel: Channel,
        state: &CommandedState,
    ) -> Option<String> {
        let unchanged = |(_, constant): &(f64, f64)| self.limit.is_constant(*constant, value);
        let (since_s, constant) = self.constant_since.filter(unchanged).unwrap_or((t_s, value));
        self.constant_since = Some((since_s, constant));
        let jumped_s = state.jumped_s.filter(|_| state.running)?;
        if t_s - jumped_s < self.limit.after_s || since_s > jumped_s {
            return None;
        }
        let value = readable(value, channel.unit());
        Some(format!(
            "is frozen: {value} since {since_s:.1} s, though the setpoints jumped at {jumped_s:.1} s"
        ))
    }
}

/// A channel without a guard of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct UnguardedChannel {
    /// Display name of its rig or instrument.
    pub source: String,
    /// The channel.
    pub channel: Channel,
    /// Time without a reading after which the channel is reported, s.
    pub age_s: f64,
    /// When the channel counts as frozen; `None`: not checked.
    pub frozen: Option<FrozenLimit>,
}

/// Reports a channel that falls silent or freezes. If identification requires it, the run ends. The check of the first seconds reports a channel that was never read.
#[derive(Debug, Clone)]
pub struct SilenceWatch {
    channels: Vec<Watched>,
}

#[derive(Debug, Clone)]
struct Watched {
    of: UnguardedChannel,
    /// Time of the last reading, s.
    last_s: Option<f64>,
    frozen: Option<FrozenReading>,
    /// Whether its silence was reported, or that it is frozen.
    reported: bool,
}

impl SilenceWatch {
    /// Creates a guard for these channels.
    pub fn new(channels: Vec<UnguardedChannel>) -> Self {
        let watched = |of: UnguardedChannel| {
            let frozen = of.frozen.map(FrozenReading::new);
            Watched { of, last_s: None, frozen, reported: false }
        };
        SilenceWatch { channels: channels.into_iter().map(watched).collect() }
    }
}

impl Guard for SilenceWatch {
    fn check(&mut self, batch: &SampleBatch, now_s: f64, state: &CommandedState) -> Option<Trip> {
        let mut trip: Option<Trip> = None;
        for Watched { of, last_s, frozen, reported } in &mut self.channels {
            let UnguardedChannel { source, channel, age_s, .. } = of;
            let from = batch.provenance_of(*channel);
            let values = batch.column(*channel).unwrap_or_default().iter().zip(&batch.t_s);
            let mut fault = None;
            for (index, (value, t_s)) in values.enumerate().filter(|(_, (value, _))| value.is_finite()) {
                let quality = from.and_then(|from| from.quality.get(index));
                // A repeated reading is as old as its source time.
                let source_s = from.and_then(|from| from.source_t_s.get(index)).unwrap_or(t_s).min(*t_s);
                if quality != Some(&Quality::Bad) && last_s.is_none_or(|last_s| source_s > last_s) {
                    *last_s = Some(source_s);
                    fault = frozen.as_mut().and_then(|one| one.check(source_s, *value, *channel, state));
                    *reported &= fault.is_some();
                }
            }
            let Some(since_s) = *last_s else { continue };
            let reason = match fault {
                Some(fault) => format!("{} ({channel}) {fault}", channel.info().description),
                None if now_s - since_s > *age_s => {
                    format!("`{source}` has given no {channel} since {since_s:.1} s")
                }
                None => continue,
            };
            if std::mem::replace(reported, true) {
                continue;
            }
            let needed = crate::guards::rig_watch::REQUIRED_CHANNELS.contains(channel);
            let reaction = if needed { Reaction::Safe } else { Reaction::Note };
            let found = Trip { t_s: now_s, guard: GuardName::Signals, reaction, reason };
            trip = match trip {
                Some(before) if before.reaction >= found.reaction => Some(before),
                _ => Some(found),
            };
        }
        trip
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::ChannelColumn;

    #[test]
    fn loss_of_a_required_channel_ends_the_run_and_of_another_is_noted_once() {
        let channel_of =
            |channel| UnguardedChannel { source: "bench".to_owned(), channel, age_s: 3.0, frozen: None };
        let batch = |t_s: f64, flow: f64, air: f64| SampleBatch {
            t_s: vec![t_s],
            columns: vec![
                ChannelColumn { channel: Channel::CompressorFlow, values: vec![flow] },
                ChannelColumn { channel: Channel::TAmb, values: vec![air] },
            ],
            ..SampleBatch::default()
        };
        let mut guard =
            SilenceWatch::new(vec![channel_of(Channel::CompressorFlow), channel_of(Channel::TAmb)]);
        let nan = f64::NAN;
        let mut look = |t_s, flow, air| guard.check(&batch(t_s, flow, air), t_s, &CommandedState::default());
        assert_eq!(look(0.0, 0.1, 298.0), None);
        assert_eq!(look(3.0, 0.1, nan), None);
        let trip = look(3.1, 0.1, nan).unwrap();
        assert_eq!(trip.reaction, Reaction::Note);
        assert!(trip.reason.contains("`bench` has given no T_amb since 0.0 s"), "{}", trip.reason);
        assert_eq!(look(5.0, 0.1, nan), None);
        // The channel returns and fails again, together with the flow, which is more severe.
        assert_eq!(look(6.0, nan, 298.0), None);
        let trip = look(9.5, nan, nan).unwrap();
        assert_eq!(trip.reaction, Reaction::Safe);
        assert!(trip.reason.contains("no m_c since 5.0 s"), "{}", trip.reason);
    }
}
