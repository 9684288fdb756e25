//! The window of a step, and the state at its end.

use crate::step_data::samples;
use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, StepError};
use mapper_core::{
    Channel, Recording, Series, SettleBands, StepMarker, Warning, Window, WindowRule, is_reading,
};
use mapper_numerics::statistics::{mean, median, robust_sigma};
use mapper_observe::fuse::SPIKE_SIGMAS;
use mapper_physics::operating_point::settled::{BLOCK_S, noise_spread, settled_count, with_bands};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EndState {
    pub(crate) speed_rpm: f64,
    pub(crate) flow_kg_s: f64,
    pub(crate) t1_k: f64,
    pub(crate) p1_pa: f64,
    pub(crate) pressure_ratio: f64,
    /// Temperature of the bearing housing: of its oil, or of the compressor's housing if the oil was not recorded.
    pub(crate) bearing_k: Option<f64>,
}

/// Means over the last seconds of the step; if a channel has no values there, over its last segment with values.
pub(crate) fn end_state(
    recording: &Recording,
    step: &StepMarker,
    config: &IdentifyConfig,
    findings: &mut Findings,
) -> Result<EndState, StepError> {
    let no_state =
        |channel| StepError::NoState { step: step.index, start_s: step.start_s, end_s: step.end_s, channel };
    let mut at = |channel: Channel| -> Result<f64, StepError> {
        let series = recording.series.get(&channel);
        let seconds = config.thresholds.end_mean_s;
        let last = series.and_then(|series| last_mean(channel, series, step, seconds));
        let (value, last_s) = last.ok_or_else(|| no_state(channel))?;
        if last_s < step.end_s - 2.0 * seconds {
            findings.doubt(Warning::EndState { channel, lost_before_end_s: step.end_s - last_s });
        }
        Ok(value)
    };
    let (speed_rpm, flow_kg_s) = (at(Channel::ShaftSpeed)?, at(Channel::CompressorFlow)?);
    let (t1_k, t2_k) = (at(Channel::T1)?, at(Channel::T2)?);
    let p1_pa = config.inlet_tap.total_pa(at(Channel::P1)?, flow_kg_s, t1_k);
    let p2_pa = config.outlet_tap.total_pa(at(Channel::P2)?, flow_kg_s, t2_k);
    let seconds = config.thresholds.end_mean_s;
    let mean_k = |channel: Channel| last_mean(channel, recording.series.get(&channel)?, step, seconds);
    let bearing_k = [Channel::TOil, Channel::Tc].into_iter().find_map(mean_k).map(|(mean_k, _)| mean_k);
    let state = EndState { speed_rpm, flow_kg_s, t1_k, p1_pa, pressure_ratio: p2_pa / p1_pa, bearing_k };
    // The correction of a static tap is unbounded.
    for (channel, value) in [(Channel::P1, p1_pa), (Channel::P2, p2_pa)] {
        if !is_reading(channel, value) {
            return Err(no_state(channel));
        }
    }
    Ok(state)
}

/// Mean of the usable values in the last `seconds` before the last one in the step, and the time of that one.
fn last_mean(channel: Channel, series: &Series, step: &StepMarker, seconds: f64) -> Option<(f64, f64)> {
    let range = series.range(step.start_s, step.end_s);
    let (t_s, values) = (&series.t_s[range.clone()], &series.values[range]);
    let last = values.iter().rposition(|value| is_reading(channel, *value))?;
    let last_s = t_s[last];
    let first = t_s.partition_point(|t| *t < last_s - seconds);
    let finite: Vec<f64> =
        values[first..=last].iter().copied().filter(|value| is_reading(channel, *value)).collect();
    Some((mean(without_spikes(&finite))?, last_s))
}

/// The values without those far from the median: a single spike would move the point.
fn without_spikes(values: &[f64]) -> Vec<f64> {
    let Some(middle) = median(values) else { return Vec::new() };
    let sigma = robust_sigma(values.iter().map(|value| value - middle)).unwrap_or(0.0);
    // Values that hardly vary give no scale for outliers.
    let limit = if sigma > 0.0 { SPIKE_SIGMAS * sigma } else { f64::INFINITY };
    values.iter().copied().filter(|value| (value - middle).abs() <= limit).collect()
}

/// Tolerance of the end of a window, s. Source: loggers round step times to milliseconds.
const STEP_ROUNDING_S: f64 = 1e-3;

/// The window of a step; `None` if the step is too short for one.
pub(crate) fn choose(
    recording: &Recording,
    step: &StepMarker,
    rule: WindowRule,
    bands: &SettleBands,
    findings: &mut Findings,
) -> Option<Window> {
    match rule {
        WindowRule::Fixed { start_s, end_s } => fixed(step, start_s, end_s, findings),
        WindowRule::Auto => settled(recording, step, bands, findings),
    }
}

fn fixed(step: &StepMarker, start_s: f64, end_s: f64, findings: &mut Findings) -> Option<Window> {
    let wanted_s = step.start_s + end_s;
    let window = Window { start_s: step.start_s + start_s, end_s: wanted_s.min(step.end_s) };
    if window.end_s + STEP_ROUNDING_S < wanted_s {
        let step_s = step.end_s - step.start_s;
        findings.remark(Warning::WindowCut { requested_end_s: end_s, step_s });
    }
    (window.start_s < window.end_s).then_some(window)
}

fn settled(
    recording: &Recording,
    step: &StepMarker,
    bands: &SettleBands,
    findings: &mut Findings,
) -> Option<Window> {
    let Settling { slowest, settled_s, earliest_s, whole } = settling(recording, step, bands)?;
    let end_s = step.end_s;
    let start_s = if whole { earliest_s } else { end_s - settled_s };
    if end_s - start_s >= WindowRule::SHORTEST_S {
        return Some(Window { start_s, end_s });
    }
    let start_s = (end_s - WindowRule::SHORTEST_S).max(earliest_s);
    findings.doubt(Warning::NotStabilised {
        quantity: slowest.to_owned(),
        settled_s,
        needed_s: WindowRule::SHORTEST_S,
        used_s: Some(end_s - start_s),
    });
    Some(Window { start_s, end_s })
}

pub(crate) struct Settling {
    /// The quantity that settles last.
    pub(crate) slowest: &'static str,
    /// How long it has been settled at the step's end, s.
    pub(crate) settled_s: f64,
    /// Earliest time checked, s.
    earliest_s: f64,
    /// Whether all quantities were settled from then on.
    pub(crate) whole: bool,
}

/// Checks a step from its end backwards; `None` for a step that ends before the earliest time.
pub(crate) fn settling(recording: &Recording, step: &StepMarker, bands: &SettleBands) -> Option<Settling> {
    let earliest_s = samples::settled_s(recording, step) + WindowRule::EARLIEST_S;
    let end_s = step.end_s;
    if end_s.is_nan() || earliest_s.is_nan() || earliest_s >= end_s {
        return None;
    }
    // Limits the number of blocks if the step times are wrong.
    let samples = recording.series.get(&Channel::ShaftSpeed).map_or(1, |series| series.t_s.len());
    let block_count = (((end_s - earliest_s) / BLOCK_S).floor() as usize).clamp(1, samples.max(1));
    let blocks = |channel| block_medians(recording.series.get(&channel), end_s, block_count);
    let (p1_pa, p2_pa) = (blocks(Channel::P1), blocks(Channel::P2));
    let pressure_ratio: Vec<f64> = p2_pa.iter().zip(&p1_pa).map(|(p2, p1)| p2 / p1).collect();
    let signals =
        with_bands(blocks(Channel::ShaftSpeed), blocks(Channel::CompressorFlow), pressure_ratio, bands);
    let (slowest, settled_blocks) = signals
        .into_iter()
        .map(|(name, backwards, allowed_ratio)| {
            let spread = noise_spread(&backwards);
            (name, settled_count(backwards, allowed_ratio, spread))
        })
        .min_by_key(|(_, blocks)| *blocks)?;
    let settled_s = settled_blocks as f64 * BLOCK_S;
    Some(Settling { slowest, settled_s, earliest_s, whole: settled_blocks == block_count })
}

/// Medians over blocks counted backwards from `end_s`; NaN for a block without values.
fn block_medians(series: Option<&Series>, end_s: f64, count: usize) -> Vec<f64> {
    let Some(series) = series else { return vec![f64::NAN; count] };
    (0..count)
        .map(|block| {
            let range = series.range(end_s - (block + 1) as f64 * BLOCK_S, end_s - block as f64 * BLOCK_S);
            median(series.values[range].iter().filter(|value| value.is_finite())).unwrap_or(f64::NAN)
        })
        .collect()
}
