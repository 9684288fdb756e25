//! The guard for channels of auxiliary instruments that no other guard checks: it reports a channel without readings.

use crate::guards::guard::{CommandedState, Guard, Trip};
use mapper_core::{Channel, GuardName, Reaction, SampleBatch};

/// A channel of an auxiliary instrument.
#[derive(Debug, Clone, PartialEq)]
pub struct InstrumentChannel {
    /// Display name of the instrument.
    pub reader: String,
    /// The channel.
    pub channel: Channel,
    /// Time without a reading after which the channel is reported, s.
    pub age_s: f64,
}

/// Reports a channel of an instrument without readings. If identification requires the channel, the run ends.
#[derive(Debug, Clone)]
pub struct InstrumentWatch {
    channels: Vec<(InstrumentChannel, Option<f64>, bool)>,
    first_poll_s: Option<f64>,
}

impl InstrumentWatch {
    /// Creates a guard for these channels.
    pub fn new(channels: Vec<InstrumentChannel>) -> Self {
        let channels = channels.into_iter().map(|channel| (channel, None, false)).collect();
        InstrumentWatch { channels, first_poll_s: None }
    }
}

impl Guard for InstrumentWatch {
    fn check(&mut self, batch: &SampleBatch, now_s: f64, _: &CommandedState) -> Option<Trip> {
        let first_s = *self.first_poll_s.get_or_insert(batch.t_s.first().copied().unwrap_or(now_s));
        let mut trip: Option<Trip> = None;
        for (channel_of, last_s, reported) in &mut self.channels {
            let readings = batch.column(channel_of.channel).unwrap_or_default().iter().zip(&batch.t_s);
            if let Some((_, t_s)) = readings.rev().find(|(value, _)| value.is_finite()) {
                (*last_s, *reported) = (Some(*t_s), false);
            }
            let since_s = last_s.unwrap_or(first_s);
            if now_s - since_s <= channel_of.age_s || *reported {
                continue;
            }
            *reported = true;
            let needed = crate::guards::start_check::REQUIRED_CHANNELS.contains(&channel_of.channel);
            let reaction = if needed { Reaction::Safe } else { Reaction::Note };
            let (reader, channel) = (&channel_of.reader, channel_of.channel);
            let reason = format!("the reader `{reader}` has given no {channel} since {since_s:.1} s");
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
        let channel_of = |channel| InstrumentChannel { reader: "bench".to_owned(), channel, age_s: 3.0 };
        let batch = |t_s: f64, flow: f64, air: f64| SampleBatch {
            t_s: vec![t_s],
            columns: vec![
                ChannelColumn { channel: Channel::CompressorFlow, values: vec![flow] },
                ChannelColumn { channel: Channel::TAmb, values: vec![air] },
            ],
            ..SampleBatch::default()
        };
        let mut guard =
            InstrumentWatch::new(vec![channel_of(Channel::CompressorFlow), channel_of(Channel::TAmb)]);
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
