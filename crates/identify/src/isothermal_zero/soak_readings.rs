//! Readings at standstill: where it is in a recording, and mean and drift of a sensor there.

use mapper_core::unit_factors::S_PER_MIN;
use mapper_core::{Channel, Recording, Series, StepMarker, is_reading, plausible};
use mapper_numerics::statistics::mean;

/// Parts of a soak: its drift is the difference of last and first; the limit leaves the first out. Source: the slope between
/// thirds has nearly the smallest error (Bartlett, Biometrics 5, 1949).
pub(super) const SOAK_PARTS: f64 = 3.0;

/// Whether a shaft is slower than any running machine's, and hence at standstill.
pub(super) fn is_at_rest(speed_rpm: f64) -> bool {
    speed_rpm.abs() < *plausible(Channel::ShaftSpeed).running.start()
}

/// The last standstill before the first step with a running machine. If steps were detected from the readings, the soak may count as a step.
pub(super) fn at_rest(recording: &Recording) -> (f64, f64) {
    let runs = |step: &&StepMarker| {
        let speed = recording.series.get(&Channel::ShaftSpeed);
        let last = speed.and_then(|speed| speed.slice(step.start_s, step.end_s).1.last());
        last.is_none_or(|speed_rpm| !is_at_rest(*speed_rpm))
    };
    let first_s = recording.steps.iter().find(runs).map_or(f64::INFINITY, |step| step.start_s);
    let Some(speed) = recording.series.get(&Channel::ShaftSpeed) else { return (0.0, 0.0) };
    let before = speed.t_s.partition_point(|t| *t < first_s);
    let rests = |i: usize| speed.values.get(i).is_some_and(|speed_rpm| is_at_rest(*speed_rpm));
    let Some(last) = (0..before).rev().find(|i| rests(*i)) else { return (0.0, 0.0) };
    let first = (0..last).rev().find(|i| !rests(*i)).map_or(0, |i| i + 1);
    // The last sample at standstill may already belong to the start of the machine.
    (speed.t_s[first], speed.t_s[last.saturating_sub(1).max(first)])
}

/// Reading of a sensor at standstill, K or Pa.
#[derive(Clone, Copy)]
pub(super) struct Reading {
    pub(super) channel: Channel,
    pub(super) mean: f64,
    /// Remaining standard deviation of its offset.
    pub(super) own: f64,
    /// The same with the declared offset.
    pub(super) total: f64,
    /// Drift, K or Pa per minute.
    pub(super) drift_per_min: f64,
    /// Standard deviation of the drift by noise.
    pub(super) drift_sigma: f64,
}

impl Reading {
    /// Without a value and an error.
    pub(super) fn of(channel: Channel) -> Self {
        Reading { channel, mean: 0.0, own: 0.0, total: 0.0, drift_per_min: 0.0, drift_sigma: 0.0 }
    }

    /// Adds an error of the zero.
    pub(super) fn widen(&mut self, sigma: f64) {
        self.own = self.own.hypot(sigma);
        self.total = self.total.hypot(sigma);
    }
}

/// Standard deviation of the common reading.
pub(super) fn combined_sigma(readings: &[Reading]) -> f64 {
    readings.iter().map(|reading| reading.total.powi(-2)).sum::<f64>().sqrt().recip()
}

/// The common reading of the sensors.
pub(super) fn common(readings: &[Reading]) -> f64 {
    let weight: f64 = readings.iter().map(|reading| reading.total.powi(-2)).sum();
    readings.iter().map(|reading| reading.mean * reading.total.powi(-2)).sum::<f64>() / weight
}

/// The plausible readings among some values.
pub(super) fn usable(channel: Channel, values: &[f64]) -> Vec<f64> {
    values.iter().copied().filter(|value| is_reading(channel, *value)).collect()
}

pub(super) struct SoakMean {
    pub(super) mean: f64,
    pub(super) drift_per_min: f64,
}

/// Mean of a channel over a segment, and its drift from the first to the last third.
pub(super) fn soak_mean(
    recording: &Recording,
    channel: Channel,
    start_s: f64,
    end_s: f64,
) -> Option<SoakMean> {
    let series: &Series = recording.series.get(&channel)?;
    let third_s = (end_s - start_s) / SOAK_PARTS;
    let of = |start_s: f64, end_s: f64| mean(usable(channel, series.slice(start_s, end_s).1));
    let (early, late) = (of(start_s, start_s + third_s)?, of(end_s - third_s, end_s)?);
    Some(SoakMean { mean: of(start_s, end_s)?, drift_per_min: (late - early) / (2.0 * third_s / S_PER_MIN) })
}
