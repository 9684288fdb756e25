//! The guard against surge. It detects surge from flow and pressures, because rigs do not report it.
//!
//! In deep surge, flow and pressure oscillate at a few hertz; before it, they fluctuate irregularly with growing amplitude. Sampling
//! at 10 Hz folds both into noise of the same size. The guard uses the median size of the second difference of three samples:
//! it is insensitive to level and slope, and a jump of the operating point affects only a few of these differences.

use crate::guards::guard::{CommandedState, Guard};
use mapper_core::{Channel, GuardName, SAMPLE_INTERVAL_S, SampleBatch, SurgeVariation, Trip};
use mapper_numerics::statistics::median;
use std::collections::VecDeque;

/// Number of samples that are evaluated: two seconds.
const SAMPLES: usize = 20;
/// Ratio of the median absolute second difference to the standard deviation of independent normal noise: 0.6745 sqrt(6).
const SECOND_DIFFERENCE: f64 = 1.652;

/// Checks flow and pressures for surge, as specified by a [`SurgeVariation`].
#[derive(Debug, Clone)]
pub struct SurgeWatch {
    spec: SurgeVariation,
    next_sample_s: f64,
    /// Newest readings of flow, P2 and P1 since the last sample. They may come from several sources with different times.
    newest: [f64; 3],
    /// Flow, P2 and P1 of the last samples.
    samples: VecDeque<[f64; 3]>,
    since_s: Option<f64>,
    last_s: f64,
    reported: bool,
}

impl SurgeWatch {
    /// Creates a guard from its specification.
    pub fn new(spec: SurgeVariation) -> Self {
        SurgeWatch {
            spec,
            next_sample_s: f64::NEG_INFINITY,
            newest: [f64::NAN; 3],
            samples: VecDeque::new(),
            since_s: None,
            last_s: 0.0,
            reported: false,
        }
    }

    /// Standard deviation of one of the three channels relative to its mean; 0 if too few readings exist.
    fn variation_ratio(&self, which: usize) -> f64 {
        let values: Vec<f64> =
            self.samples.iter().map(|look| look[which]).filter(|value| value.is_finite()).collect();
        if values.len() < SAMPLES / 2 {
            return 0.0;
        }
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let second = values.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs());
        let typical = median(second.collect::<Vec<f64>>().iter()).unwrap_or(0.0) / SECOND_DIFFERENCE;
        if mean.abs() > 0.0 { typical / mean.abs() } else { 0.0 }
    }

    fn detect_surge(&self) -> Option<(f64, f64)> {
        let flow = self.variation_ratio(0);
        if flow <= self.spec.flow_ratio {
            return None;
        }
        let pressure = self.variation_ratio(1).max(self.variation_ratio(2));
        (pressure > self.spec.pressure_ratio).then_some((flow, pressure))
    }
}

impl Guard for SurgeWatch {
    fn check(&mut self, batch: &SampleBatch, _: f64, state: &CommandedState) -> Option<Trip> {
        if !state.running {
            self.samples.clear();
            (self.since_s, self.reported) = (None, false);
            return None;
        }
        let columns =
            [Channel::CompressorFlow, Channel::P2, Channel::P1].map(|channel| batch.column(channel));
        for (index, t_s) in batch.t_s.iter().enumerate() {
            for (newest, column) in self.newest.iter_mut().zip(&columns) {
                let value = column.and_then(|values| values.get(index)).copied();
                *newest = value.filter(|value| value.is_finite()).unwrap_or(*newest);
            }
            if *t_s < self.next_sample_s - 1e-6 {
                continue;
            }
            (self.next_sample_s, self.last_s) = (t_s + SAMPLE_INTERVAL_S, *t_s);
            self.samples.push_back(std::mem::replace(&mut self.newest, [f64::NAN; 3]));
            if self.samples.len() > SAMPLES {
                self.samples.pop_front();
            }
            let Some((flow, pressure)) = self.detect_surge() else {
                (self.since_s, self.reported) = (None, false);
                continue;
            };
            let since_s = *self.since_s.get_or_insert(*t_s);
            if t_s - since_s > self.spec.dwell_s && !self.reported {
                self.reported = true;
                return Some(Trip {
                    t_s: *t_s,
                    guard: GuardName::Surge,
                    reaction: self.spec.reaction,
                    reason: format!(
                        "the compressor surges: its flow has varied by {:.1} % and its pressures by {:.1} % since {since_s:.1} s, \
                         longer than the {:.1} s allowed",
                        100.0 * flow,
                        100.0 * pressure,
                        self.spec.dwell_s
                    ),
                });
            }
        }
        None
    }

    fn is_violated(&self) -> bool {
        self.since_s.is_some()
    }

    fn is_alert(&self) -> bool {
        // A jump may exceed the threshold briefly: only a lasting violation needs sample-by-sample polling.
        self.since_s.is_some_and(|since_s| self.last_s - since_s > self.spec.dwell_s - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{ChannelColumn, Reaction};

    const SPEC: SurgeVariation =
        SurgeVariation { flow_ratio: 0.05, pressure_ratio: 0.01, dwell_s: 5.0, reaction: Reaction::Safe };

    /// Time of the trip, s, for a flow of 0.05 kg/s and P2 of 150 kPa at 100 Hz with these relative variations.
    fn trips_at_s(flow: impl Fn(f64) -> f64, p2: impl Fn(f64) -> f64) -> Option<f64> {
        let mut guard = SurgeWatch::new(SPEC);
        let state = CommandedState { running: true, ..CommandedState::default() };
        (0..60).find_map(|second| {
            let t_s: Vec<f64> = (0..100).map(|i| f64::from(second) + 0.01 * f64::from(i)).collect();
            let column = |channel, mean: f64, course: &dyn Fn(f64) -> f64| ChannelColumn {
                channel,
                values: t_s.iter().map(|t| mean * (1.0 + course(*t))).collect(),
            };
            let columns = vec![column(Channel::CompressorFlow, 0.05, &flow), column(Channel::P2, 150e3, &p2)];
            let batch = SampleBatch { columns, t_s: t_s.clone(), ..SampleBatch::default() };
            guard.check(&batch, t_s[99], &state).map(|trip| trip.t_s)
        })
    }

    /// A surge cycle of 7.3 Hz, 8 % of the flow and 1.6 % of P2, from 10 s on. The guard has to trip within two seconds after the dwell.
    /// Frequencies within about 2 Hz of a multiple of the 10 Hz sampling rate are excluded: folding makes them slow.
    #[test]
    fn a_surge_cycle_trips_after_its_dwell() {
        for hertz in [3.7, 4.3, 7.3, 16.9] {
            let swing = |t: f64| if t < 10.0 { 0.0 } else { (std::f64::consts::TAU * hertz * t).sin() };
            let t_s = trips_at_s(|t| 0.08 * swing(t), |t| 0.016 * swing(t)).unwrap_or(f64::NAN);
            assert!((15.0..17.5).contains(&t_s), "{hertz} Hz: {t_s} s");
        }
    }

    #[test]
    fn jumps_ramps_and_flow_noise_alone_do_not_trip() {
        let swing = |t: f64| (std::f64::consts::TAU * 7.3 * t).sin();
        // The operating point jumps by 50 % every ten seconds.
        let jump = |t: f64| if (t / 10.0) as i64 % 2 == 0 { 0.0 } else { 0.5 };
        assert_eq!(trips_at_s(jump, jump), None);
        assert_eq!(trips_at_s(|t| 0.02 * t, |t| 0.02 * t), None);
        assert_eq!(trips_at_s(|t| 0.2 * swing(t), |_| 0.0), None, "a noisy flow meter");
        assert_eq!(trips_at_s(|_| 0.0, |t| 0.05 * swing(t)), None, "a pulsating line");
    }
}
