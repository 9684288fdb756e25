//! The guard for one channel: value, rate of change, age, quality, and a frozen reading.

use crate::guards::guard::{CommandedState, Guard};
use mapper_core::{
    Channel, FrozenLimit, GuardName, Quality, Reaction, SampleBatch, SignalGuard, Trip, is_possible, readable,
};
use std::collections::VecDeque;

/// A continuing violation trips again after this time, s.
const REPEAT_TRIP_S: f64 = 10.0;
/// Relative distance to a bound below which the rig is polled sample by sample.
const NEAR_RATIO: f64 = 0.03;
/// Time over which the slope is computed, s.
const SLOPE_S: f64 = 0.5;
/// Minimum spacing of the readings kept for a change, as a share of its time. It bounds the memory for fast rigs.
const CHANGE_RESOLUTION_RATIO: f64 = 1e-3;

/// Checks one channel as specified by a [`SignalGuard`].
#[derive(Debug, Clone)]
pub struct SignalWatch {
    spec: SignalGuard,
    /// Source time of the last good reading, s.
    last_good_s: Option<f64>,
    /// Time of the first sample or poll, s: age counts from there.
    first_poll_s: Option<f64>,
    last_value: Option<f64>,
    /// Time and value of a reading about half a second ago, and the slope since then, unit of the channel per second.
    anchor: Option<(f64, f64)>,
    slope_per_s: f64,
    /// Start of the violation of a bound, s.
    beyond_since_s: Option<f64>,
    /// A continuing violation does not trip again before this time, s.
    quiet_until_s: Option<f64>,
    /// Times and readings within the window of the change limit.
    recent: VecDeque<(f64, f64)>,
    frozen: Option<FrozenReading>,
}

impl SignalWatch {
    /// Creates a guard from its specification.
    pub fn new(spec: SignalGuard) -> Self {
        SignalWatch {
            spec,
            last_good_s: None,
            first_poll_s: None,
            last_value: None,
            anchor: None,
            slope_per_s: 0.0,
            beyond_since_s: None,
            quiet_until_s: None,
            recent: VecDeque::new(),
            frozen: spec.frozen.map(FrozenReading::new),
        }
    }

    fn trip(&mut self, t_s: f64, reaction: Reaction, message: &str) -> Option<Trip> {
        if self.quiet_until_s.is_some_and(|quiet_s| t_s < quiet_s) {
            return None;
        }
        self.quiet_until_s = Some(t_s + REPEAT_TRIP_S);
        let channel = self.spec.channel;
        let reason = format!("{} ({channel}) {message}", channel.info().description);
        Some(Trip { t_s, guard: self.spec.name, reaction, reason })
    }

    fn describe_violation(&self, value: f64, running: bool, slack: f64) -> Option<String> {
        let unit = self.spec.channel.unit();
        match (self.spec.above, self.spec.below) {
            (Some(high), _) if value > high - slack => {
                Some(format!("is {}, above its limit of {}", readable(value, unit), readable(high, unit)))
            }
            (_, Some(low)) if running && value < low + slack => {
                Some(format!("is {}, below its limit of {}", readable(value, unit), readable(low, unit)))
            }
            _ => None,
        }
    }

    fn check_sample(&mut self, t_s: f64, value: f64, state: &CommandedState) -> Option<Trip> {
        // The slope over a single sample would be noise.
        match self.anchor {
            Some((then_s, earlier)) if t_s - then_s >= SLOPE_S => {
                self.slope_per_s = (value - earlier) / (t_s - then_s);
                self.anchor = Some((t_s, value));
            }
            Some(_) => {}
            None => self.anchor = Some((t_s, value)),
        }
        self.last_good_s = Some(t_s);
        let channel = self.spec.channel;
        let frozen = self.frozen.as_mut().and_then(|frozen| frozen.check(t_s, value, channel, state));
        self.last_value = Some(value);
        // Hysteresis: after a violation, the value has to return past the bound by this amount.
        let slack = if self.beyond_since_s.is_some() { self.spec.hysteresis } else { 0.0 };
        if let Some(message) = self.describe_violation(value, state.running, slack) {
            let since_s = *self.beyond_since_s.get_or_insert(t_s);
            // One microsecond covers the rounding of accumulated sample times.
            if t_s - since_s >= self.spec.dwell_s - 1e-6 {
                return self.trip(t_s, self.spec.reaction, &message);
            }
        } else {
            self.beyond_since_s = None;
        }
        self.check_change(t_s, value).or_else(|| {
            let frozen = frozen?;
            self.trip(t_s, self.spec.reaction.max(Reaction::Safe), &frozen)
        })
    }

    fn check_change(&mut self, t_s: f64, value: f64) -> Option<Trip> {
        let limit = self.spec.change?;
        while self.recent.front().is_some_and(|(then_s, _)| t_s - then_s > limit.within_s) {
            self.recent.pop_front();
        }
        let (low, high) = self
            .recent
            .iter()
            .fold((value, value), |(low, high), (_, earlier)| (low.min(*earlier), high.max(*earlier)));
        let min_spacing_s = CHANGE_RESOLUTION_RATIO * limit.within_s;
        if self.recent.back().is_none_or(|(then_s, _)| t_s - then_s >= min_spacing_s) {
            self.recent.push_back((t_s, value));
        }
        let change = (value - low).max(high - value);
        if change <= limit.change {
            return None;
        }
        let unit = self.spec.channel.unit();
        let message = format!(
            "has changed by {change:.1} {unit} within {:.0} s, more than the {:.1} {unit} allowed",
            limit.within_s, limit.change
        );
        self.trip(t_s, self.spec.reaction, &message)
    }
}

impl Guard for SignalWatch {
    fn check(&mut self, batch: &SampleBatch, now_s: f64, state: &CommandedState) -> Option<Trip> {
        let first_s = *self.first_poll_s.get_or_insert(batch.t_s.first().copied().unwrap_or(now_s));
        if let Some(values) = batch.column(self.spec.channel) {
            let provenance = batch.provenance_of(self.spec.channel);
            let mut first_trip: Option<Trip> = None;
            for (index, (t_s, value)) in batch.t_s.iter().zip(values).enumerate() {
                let bad = provenance.is_some_and(|from| from.quality.get(index) == Some(&Quality::Bad));
                // A stale or repeated value is as old as its source time.
                let source_s = provenance.and_then(|from| from.source_t_s.get(index)).copied();
                let reading_s = source_s.map_or(*t_s, |source_s| source_s.min(*t_s));
                let new = self.last_good_s.is_none_or(|last_s| reading_s > last_s);
                // A value above its limit counts even if it is implausible.
                let above = value.is_finite() && self.spec.above.is_some_and(|high| *value > high);
                let read = above || is_possible(self.spec.channel, *value, state.running);
                if read && reading_s.is_finite() && !bad && new {
                    let trip = self.check_sample(reading_s, *value, state);
                    first_trip = first_trip.or(trip);
                }
            }
            if first_trip.is_some() {
                return first_trip;
            }
        }
        // Age counts from the first poll, even if no samples arrive.
        let since_s = self.last_good_s.unwrap_or(first_s);
        if now_s - since_s > self.spec.age_s {
            let message = format!("has given no good reading since {since_s:.1} s");
            return self.trip(now_s, self.spec.reaction.max(Reaction::Safe), &message);
        }
        None
    }

    fn is_violated(&self) -> bool {
        self.beyond_since_s.is_some()
    }

    fn is_alert(&self) -> bool {
        let Some(value) = self.last_value else { return false };
        // A bound that the value may reach within a second needs closer polling.
        let soon = value + self.slope_per_s.max(0.0);
        self.beyond_since_s.is_some()
            || self.spec.above.is_some_and(|high| value.max(soon) > high - NEAR_RATIO * high.abs())
    }
}

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
    use mapper_core::{ChannelColumn, LargestChange, Provenance};

    fn spec() -> SignalGuard {
        SignalGuard {
            name: GuardName::CompressorOutletTemperature,
            channel: Channel::T2,
            above: Some(400.0),
            below: None,
            change: None,
            hysteresis: 2.0,
            dwell_s: 0.2,
            age_s: 0.5,
            frozen: None,
            reaction: Reaction::Hold,
        }
    }

    fn batch(first: u64, values: &[f64]) -> SampleBatch {
        SampleBatch {
            first_sequence: first,
            t_s: (0..values.len()).map(|i| (first + i as u64) as f64 * 0.1).collect(),
            columns: vec![ChannelColumn { channel: Channel::T2, values: values.to_vec() }],
            ..SampleBatch::default()
        }
    }

    fn check(guard: &mut SignalWatch, batch: &SampleBatch, now_s: f64) -> Option<Trip> {
        guard.check(batch, now_s, &CommandedState { running: true, ..CommandedState::default() })
    }

    #[test]
    fn a_violation_trips_after_its_dwell_across_batches_despite_nan() {
        let mut guard = SignalWatch::new(SignalGuard { hysteresis: 0.0, ..spec() });
        assert_eq!(check(&mut guard, &batch(0, &[401.0, 399.0, 401.0, f64::NAN]), 0.3), None);
        assert!(guard.is_violated() && guard.is_alert());
        let trip = check(&mut guard, &batch(4, &[401.5]), 0.4).unwrap();
        assert_eq!((trip.t_s, trip.reaction), (0.4, Reaction::Hold));
        assert!(trip.reason.contains("401.5 K") && trip.reason.contains("400.0 K"), "{}", trip.reason);
        // The violation was already reported.
        assert_eq!(check(&mut guard, &batch(5, &[401.5; 5]), 0.9), None);
    }

    #[test]
    fn hysteresis_keeps_a_flapping_value_one_violation() {
        let mut guard = SignalWatch::new(SignalGuard { dwell_s: 0.0, ..spec() });
        let trips: Vec<Trip> = (0..50)
            .filter_map(|i| {
                let value = if i % 2 == 0 { 400.5 } else { 399.5 };
                check(&mut guard, &batch(i, &[value]), i as f64 * 0.1)
            })
            .collect();
        assert_eq!(trips.len(), 1, "{trips:?}");
        assert!(guard.is_violated());
        check(&mut guard, &batch(50, &[397.0]), 5.0);
        assert!(!guard.is_violated());
    }

    #[test]
    fn missing_bad_and_old_readings_end_the_run() {
        let nothing = SampleBatch::default();
        let good = batch(0, &[300.0; 2]);
        let bad = |source_s: f64, quality| SampleBatch {
            provenance: vec![Provenance {
                channel: Channel::T2,
                source_t_s: vec![source_s; 10],
                quality: vec![quality; 10],
            }],
            ..batch(2, &[300.0; 10])
        };
        for (message, later) in [
            ("an empty batch", nothing.clone()),
            ("NaN", batch(2, &[f64::NAN; 10])),
            ("no column", SampleBatch { columns: Vec::new(), ..batch(2, &[300.0; 10]) }),
            ("bad quality", bad(1.0, Quality::Bad)),
            ("an old source", bad(0.1, Quality::Good)),
        ] {
            let mut guard = SignalWatch::new(spec());
            assert_eq!(check(&mut guard, &good, 0.1), None, "{message}");
            let trip = check(&mut guard, &later, 1.1).unwrap_or_else(|| panic!("{message}"));
            assert_eq!(trip.reaction, Reaction::Safe, "{message}");
            assert!(trip.reason.contains("no good reading since 0.1 s"), "{message}: {}", trip.reason);
        }
        // A source that never delivered a reading.
        let mut guard = SignalWatch::new(spec());
        assert_eq!(check(&mut guard, &nothing, 0.0), None);
        assert!(check(&mut guard, &nothing, 0.6).is_some());
    }

    /// A clock set back by an hour looks like a source without new readings; a clock set forward does not.
    #[test]
    fn a_source_clock_that_is_set_back_trips_and_one_set_forward_does_not() {
        for (step_s, trips) in [(-3600.0, true), (3600.0, false)] {
            let mut guard = SignalWatch::new(spec());
            assert_eq!(check(&mut guard, &batch(0, &[300.0; 2]), 0.1), None);
            let later = batch(2, &[300.0; 10]);
            let source_t_s = later.t_s.iter().map(|t_s| t_s + step_s).collect();
            let quality = vec![Quality::Good; 10];
            let provenance = vec![Provenance { channel: Channel::T2, source_t_s, quality }];
            let trip = check(&mut guard, &SampleBatch { provenance, ..later }, 1.1);
            assert_eq!(trip.is_some(), trips, "set by {step_s} s: {trip:?}");
        }
    }

    /// The unit changes during the run (degC for K, kPa for Pa): no limit trips, but the readings count as missing.
    #[test]
    fn impossible_readings_count_as_missing_unless_they_exceed_a_limit() {
        for (channel, good, wrong) in [
            (Channel::T2, 390.0, 117.0),
            (Channel::T2, 390.0, -50.0),
            (Channel::P2, 180e3, 180.0),
            (Channel::P2, 180e3, 1e12),
            (Channel::CompressorFlow, 0.08, -5.0),
        ] {
            let spec = SignalGuard { channel, above: None, ..spec() };
            let at = |first, value: f64, count| SampleBatch {
                columns: vec![ChannelColumn { channel, values: vec![value; count] }],
                ..batch(first, &vec![value; count])
            };
            let mut guard = SignalWatch::new(spec);
            assert_eq!(check(&mut guard, &at(0, good, 20), 1.9), None, "{channel} {good}");
            let trip = check(&mut guard, &at(20, wrong, 10), 2.9).unwrap();
            assert_eq!(trip.reaction, Reaction::Safe, "{channel} {wrong}");
        }
        // A broken wire that reads 5000 K trips like a temperature above its limit.
        let mut guard = SignalWatch::new(spec());
        let trip = check(&mut guard, &batch(0, &[5000.0; 3]), 0.2).unwrap();
        assert_eq!(trip.reaction, Reaction::Hold);
    }

    #[test]
    fn a_large_change_and_a_frozen_reading_trip() {
        let change = Some(LargestChange { change: 5.0, within_s: 1.0 });
        let mut guard = SignalWatch::new(SignalGuard { above: None, change, ..spec() });
        assert_eq!(check(&mut guard, &batch(0, &[300.0, 301.0, 302.0, 303.0]), 0.3), None);
        assert!(check(&mut guard, &batch(4, &[306.0]), 0.4).unwrap().reason.contains("6.0 K within 1 s"));
        let mut guard = SignalWatch::new(SignalGuard {
            frozen: Some(FrozenLimit { after_s: 2.0, band: 0.01 }),
            ..spec()
        });
        let after_jump = |jumped_s| CommandedState {
            running: true,
            jumped_s: Some(jumped_s),
            ..CommandedState::default()
        };
        // Unchanged without a jump; moved after one; not moved.
        assert_eq!(guard.check(&batch(0, &[300.0; 100]), 9.9, &after_jump(9.5)), None);
        let mut moved = guard.clone();
        assert_eq!(moved.check(&batch(100, &[300.1; 30]), 12.9, &after_jump(9.5)), None);
        let trip = guard.clone().check(&batch(100, &[300.0; 30]), 12.9, &after_jump(9.5)).unwrap();
        assert_eq!(trip.reaction, Reaction::Safe);
        // A flickering last digit is not movement.
        let flicker: Vec<f64> = (0..30).map(|i| 300.0 + 9e-3 * f64::from(i % 2)).collect();
        assert!(guard.check(&batch(100, &flicker), 12.9, &after_jump(9.5)).is_some());
        assert!((trip.t_s - 11.5).abs() < 0.11 && trip.reason.contains("frozen"), "{trip:?}");
    }

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
