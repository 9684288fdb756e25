//! The position on the map at which a step ended: means over its last seconds.

use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, StepError};
use mapper_core::{Channel, Recording, Series, StepMarker, Warning, is_reading};
use mapper_numerics::statistics::{mean, median, robust_sigma};
use mapper_observe::redundant_sensors::fuse::SPIKE_SIGMAS;

/// The operating point at the end of a step.
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
