//! Readings at standstill: where it is in a recording, and mean and drift of a sensor there.

use mapper_core::unit_factors::S_PER_MIN;
use mapper_core::{Channel, EventKind, Recording, Series, StepMarker, is_reading, plausible};
use mapper_numerics::statistics::{mean, nearest_rank};

/// Parts of a soak: its drift is the difference of last and first; the limit leaves the first out. Source: the slope between
/// thirds has nearly the smallest error (Bartlett, Biometrics 5, 1949).
pub(super) const SOAK_PARTS: f64 = 3.0;

/// Shortest standstill in which sensors are compared, s. Bound: pipes empty within seconds, and its second half averages noise to a quarter.
const SHORTEST_REST_S: f64 = 30.0;
/// Rank of the reading that counts as that of the running machine. Bound: a run of a few minutes in half an hour of rest.
const RUNNING_SHARE: f64 = 0.99;
/// Share of that flow below which none flows. Bound: the zero error of a flow meter.
const STILL_FLOW_SHARE: f64 = 0.05;

/// Whether a shaft is slower than any running machine's, and hence at standstill.
pub(super) fn is_at_rest(speed_rpm: f64) -> bool {
    speed_rpm.abs() < *plausible(Channel::ShaftSpeed).running.start()
}

/// The last standstill before the first step with a running machine, or the last zero between steps. If steps were detected from the readings, the
/// soak may count as a step.
pub(super) fn at_rest(recording: &Recording) -> (f64, f64) {
    let runs = |step: &&StepMarker| {
        let speed = recording.series.get(&Channel::ShaftSpeed);
        let last = speed.and_then(|speed| speed.slice(step.start_s, step.end_s).1.last());
        last.is_none_or(|speed_rpm| !is_at_rest(*speed_rpm))
    };
    let first_s = recording.steps.iter().find(runs).map_or(f64::INFINITY, |step| step.start_s);
    let later =
        recording.events.iter().rfind(|event| event.kind == EventKind::SoakEnded && event.t_s > first_s);
    let before_s = later.map_or(first_s, |soak| soak.t_s);
    standstills(recording, before_s).pop().unwrap_or_default()
}

/// Every standstill that begins before `before_s`, in order.
fn standstills(recording: &Recording, before_s: f64) -> Vec<(f64, f64)> {
    let Some(speed) = recording.series.get(&Channel::ShaftSpeed) else { return Vec::new() };
    let before = speed.t_s.partition_point(|t| *t < before_s).min(speed.values.len());
    let places: Vec<usize> = (0..before).filter(|i| is_at_rest(speed.values[*i])).collect();
    // The last sample at standstill may already belong to the start of the machine.
    let span = |run: &[usize]| (speed.t_s[run[0]], speed.t_s[run[run.len().saturating_sub(2)]]);
    places.chunk_by(|a, b| b - a == 1).map(span).collect()
}

/// The standstills of a recording whose machine turns at another time, and in which no air flows: a dead pick-up also reads no speed.
pub(super) fn rests(recording: &Recording) -> Vec<(f64, f64)> {
    let size = |channel: Channel, (start_s, end_s): (f64, f64), share: f64| {
        let values = recording.series.get(&channel)?.slice(start_s, end_s).1;
        nearest_rank(values.iter().filter(|value| value.is_finite()).map(|value| value.abs()), share)
    };
    let whole = (f64::NEG_INFINITY, f64::INFINITY);
    let turns = size(Channel::ShaftSpeed, whole, RUNNING_SHARE).is_some_and(|rpm| !is_at_rest(rpm));
    let is_still = |rest: &(f64, f64)| {
        [Channel::CompressorFlow, Channel::TurbineFlow].into_iter().all(|flow| {
            let (here, running) = (size(flow, *rest, 0.5), size(flow, whole, RUNNING_SHARE));
            here.zip(running).is_none_or(|(here, running)| here < STILL_FLOW_SHARE * running)
        })
    };
    let all = if turns { standstills(recording, f64::INFINITY) } else { Vec::new() };
    all.into_iter().filter(|rest| rest.1 - rest.0 >= SHORTEST_REST_S && is_still(rest)).collect()
}

/// Reading of a sensor at standstill, K or Pa.
#[derive(Clone, Copy)]
pub(crate) struct Reading {
    pub(crate) channel: Channel,
    pub(crate) mean: f64,
    /// Remaining standard deviation of its offset.
    pub(crate) own: f64,
    /// The same with the declared offset.
    pub(crate) total: f64,
    /// Drift, K or Pa per minute.
    pub(crate) drift_per_min: f64,
    /// Standard deviation of the drift by noise.
    pub(crate) drift_sigma: f64,
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

pub(super) fn common(readings: &[Reading]) -> f64 {
    let weight: f64 = readings.iter().map(|reading| reading.total.powi(-2)).sum();
    readings.iter().map(|reading| reading.mean * reading.total.powi(-2)).sum::<f64>() / weight
}

/// The plausible readings among some values.
pub(super) fn usable(channel: Channel, values: &[f64]) -> Vec<f64> {
    values.iter().copied().filter(|value| is_reading(channel, *value)).collect()
}

pub(super) struct SoakMean {
    pub(crate) mean: f64,
    pub(crate) drift_per_min: f64,
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
