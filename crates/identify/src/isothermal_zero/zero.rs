//! The isothermal zero: sensor offsets from a state in which all sensors must read the same.
//!
//! In a long soak at standstill the shaft is stopped, and oil and cell have one temperature. T1, T2, Tc and T_oil then see one temperature,
//! and P1 and P2 one pressure. Their differences are offsets, up to the residual non-uniformity of the rig. Their common error keeps its
//! declared uncertainty. It changes an efficiency only by its share of the absolute temperature, which is negligible, but it matters in a
//! diagnosis of the whole machine.

use crate::IdentifyConfig;
use crate::isothermal_zero::relaxation;
use crate::step_data::samples::TREND_BLOCK_S;
use mapper_core::unit_factors::S_PER_MIN;
use mapper_core::{
    Channel, DeclaredUncertainty, Recording, SAMPLE_INTERVAL_S, Series, Soak, StepMarker, is_reading,
    plausible,
};
use mapper_numerics::coloured_noise::variance_of_mean;
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, mean};
use mapper_observe::declared::{CommonOffset, rest_pressure_pa};
use mapper_physics::rig::sensor_fault::gain_error;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Longest segment at the end of a soak that is used, s. Bound: on average over it, noise of 0.1 K is below 0.01 K.
const LONGEST_SOAK_S: f64 = 600.0;
/// Minimum length of that segment, s. Bound: noise of 0.1 K at 10 Hz leaves its drift an error of 0.02 K/min.
const SHORTEST_SOAK_S: f64 = 60.0;
/// Maximum drift of a temperature over it, K/min. Bound: housings of 10 minutes are then within 1 K of their limit.
const MAX_SOAK_DRIFT_K_MIN: f64 = 0.1;
/// Parts of a soak: its drift is the difference of last and first; the limit leaves the first out. Source: the slope between
/// thirds has nearly the smallest error (Bartlett, Biometrics 5, 1949).
const SOAK_PARTS: f64 = 3.0;

/// Residual non-uniformity of a soak, and the criteria by which a soak is recognised.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ZeroSettings {
    /// Residual temperature non-uniformity (one standard deviation of a sensor from the mean), K, > 0.
    pub temperature_sigma_k: f64,
    /// Residual pressure non-uniformity, one standard deviation, Pa, > 0.
    pub pressure_sigma_pa: f64,
    /// Longest segment before the first step that is used, s: the last one of the standstill.
    pub longest_s: f64,
    /// Minimum length of the segment, s.
    pub shortest_s: f64,
    /// Maximum drift of a temperature over the segment, K/min; a faster drift means an unfinished soak.
    pub drift_k_min: f64,
    /// Whether one temperature sensor may exceed its declared offset.
    pub allows_a_fault: bool,
}

impl Default for ZeroSettings {
    /// Default non-uniformity; accepts the last minute to ten minutes if they drift by less than 0.1 K/min.
    fn default() -> Self {
        ZeroSettings {
            temperature_sigma_k: Soak::TEMPERATURE_SIGMA_K,
            pressure_sigma_pa: Soak::PRESSURE_SIGMA_PA,
            longest_s: LONGEST_SOAK_S,
            shortest_s: SHORTEST_SOAK_S,
            drift_k_min: MAX_SOAK_DRIFT_K_MIN,
            allows_a_fault: false,
        }
    }
}

impl From<Soak> for ZeroSettings {
    /// With the declared non-uniformity.
    fn from(soak: Soak) -> Self {
        ZeroSettings {
            temperature_sigma_k: soak.temperature_sigma_k,
            pressure_sigma_pa: soak.pressure_sigma_pa,
            ..ZeroSettings::default()
        }
    }
}

/// The estimated offsets and their segment.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct IsothermalZero {
    /// Start of the segment, s.
    pub start_s: f64,
    /// End of the segment, s.
    pub end_s: f64,
    /// Reading minus the common reading, K or Pa.
    pub offsets: BTreeMap<Channel, f64>,
    /// Remaining standard deviation of each offset, K or Pa.
    pub left_sigma: BTreeMap<Channel, f64>,
    /// Remaining common error of all offsets of one dimension: the common reading is only as accurate as the declared offsets.
    #[serde(default)]
    pub common: Vec<CommonOffset>,
}

/// Why a recording has no isothermal zero.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum NoZero {
    #[error("the shaft rests for {found_s:.0} s before the first step; the zero needs {needed_s:.0} s")]
    NoSoak { found_s: f64, needed_s: f64 },
    #[error(
        "{channel} still drifts by {drift_k_min:+.2} K/min in the soak (limit {limit_k_min:.2}): soak longer"
    )]
    Drifts { channel: Channel, drift_k_min: f64, limit_k_min: f64 },
    /// `off`: minus the common reading, K or Pa; `sigma`: expected standard deviation.
    #[error(
        "{channel} reads {off:+.2} {} off the others in the soak, {:.1} times its declared offset: the rig is not uniform, or the sensor is broken",
        channel.unit(), off.abs() / sigma
    )]
    Uneven { channel: Channel, off: f64, sigma: f64 },
}

/// Finds the offsets of T1, T2, Tc and T_oil against each other, and of P1 and P2.
///
/// Channels without a declared offset count as exact. Common temperature and pressure are means weighted by declared offset and
/// non-uniformity. If a fault is allowed, drifting oil is left out, and a temperature sensor that exceeds its declared offset is compared with
/// the others; if two pressure taps differ by more, either may be wrong, so both keep their declared offsets.
///
/// # Errors
/// [`NoZero`] if the recording has no soak, or an unsuitable one.
pub fn isothermal_zero(
    recording: &Recording,
    config: &IdentifyConfig,
    settings: &ZeroSettings,
) -> Result<IsothermalZero, NoZero> {
    let (start_s, end_s) = at_rest(recording);
    let no_soak = NoZero::NoSoak { found_s: (end_s - start_s).max(0.0), needed_s: settings.shortest_s };
    if (end_s - start_s).is_nan() || end_s - start_s < settings.shortest_s {
        return Err(no_soak);
    }
    let rest = (start_s, end_s);
    let start_s = start_s.max(end_s - settings.longest_s);
    let mut zero = IsothermalZero { start_s, end_s, ..IsothermalZero::default() };
    for (group, sigma) in groups(settings) {
        let mut readings = Vec::new();
        for channel in group {
            let Some(reading) = soak_mean(recording, *channel, start_s, end_s) else { continue };
            let drifts = group.len() > 2 && reading.drift_per_min.abs() > settings.drift_k_min;
            // A drifting oil supply is independent of the cell, and no other sensor depends on it.
            if drifts && settings.allows_a_fault && *channel == Channel::TOil {
                continue;
            }
            if drifts {
                return Err(NoZero::Drifts {
                    channel: *channel,
                    drift_k_min: reading.drift_per_min,
                    limit_k_min: settings.drift_k_min,
                });
            }
            let declared = config.sensor(*channel);
            let mut mean = reading.mean;
            let mut own = sigma.hypot(sigma_of_mean(declared.noise_sigma, end_s - start_s, config));
            // The housing reaches the cell's temperature last, and its drift is below the threshold.
            if *channel == Channel::Tc
                && let Some((limit, error)) = housing_limit(recording, rest, config, settings)
            {
                (mean, own) = (limit, sigma.hypot(error));
            }
            let gain_sigma = declared.gain_sigma_ratio * gain_error(*channel, mean, 0.0);
            let total = own.hypot(declared.offset_sigma).hypot(gain_sigma);
            readings.push(Reading { channel: *channel, mean, own, total });
        }
        let mut common = common(&readings);
        if readings.len() < 2 || !common.is_finite() {
            continue;
        }
        let uneven = |common: f64, at_fault: Option<Channel>| {
            let mut fault_free = readings.iter().filter(|reading| Some(reading.channel) != at_fault);
            fault_free.find(|reading| (reading.mean - common).abs() > EXCLUDE_SIGMAS * reading.total)
        };
        if let Some(first) = uneven(common, None) {
            let Reading { channel, mean, total, .. } = *first;
            let refused = NoZero::Uneven { channel, off: mean - common, sigma: total };
            if !settings.allows_a_fault {
                return Err(refused);
            }
            if readings.len() < 3 {
                continue;
            }
            // Leave out the sensor without which the others agree best.
            let without = |channel: Channel| {
                let others: Vec<Reading> =
                    readings.iter().filter(|other| other.channel != channel).copied().collect();
                let common = self::common(&others);
                let spread: f64 =
                    others.iter().map(|other| ((other.mean - common) / other.total).powi(2)).sum();
                (channel, common, spread)
            };
            let tried = readings.iter().map(|reading| without(reading.channel));
            let Some((at_fault, of_others, _)) = tried.min_by(|a, b| a.2.total_cmp(&b.2)) else { continue };
            if uneven(of_others, Some(at_fault)).is_some() {
                return Err(refused);
            }
            common = of_others;
        }
        let weight: f64 = readings.iter().map(|reading| reading.total.powi(-2)).sum();
        zero.common.push(CommonOffset {
            channels: readings.iter().map(|reading| reading.channel).collect(),
            sigma: weight.sqrt().recip(),
            reading: common,
        });
        for reading in readings {
            zero.offsets.insert(reading.channel, reading.mean - common);
            zero.left_sigma.insert(reading.channel, reading.own);
        }
    }
    if zero.offsets.is_empty() { Err(no_soak) } else { Ok(zero) }
}

/// The recording without the offsets, and the configuration with the remaining uncertainty as declared offset: prior of the joint method, bias
/// of the others.
pub fn zeroed(
    mut recording: Recording,
    mut config: IdentifyConfig,
    zero: &IsothermalZero,
) -> (Recording, IdentifyConfig) {
    config.rest_pressure_pa = rest_pressure_pa(&zero.common);
    for (channel, offset) in &zero.offsets {
        if let Some(series) = recording.series.get_mut(channel) {
            series.values.iter_mut().for_each(|value| *value -= offset);
        }
        if let (Some(declared), Some(left)) = (config.declared.get_mut(channel), zero.left_sigma.get(channel))
        {
            *declared = DeclaredUncertainty { offset_sigma: *left, ..*declared };
        }
    }
    (recording, config)
}

/// Predicts the remaining offset uncertainty after a zero of `soak_s` at this pressure.
pub fn expected_after_zero(
    mut config: IdentifyConfig,
    settings: &ZeroSettings,
    soak_s: f64,
    pressure_pa: f64,
) -> IdentifyConfig {
    config.rest_pressure_pa = pressure_pa;
    let used_s = soak_s.min(settings.longest_s);
    for (channels, sigma) in groups(settings) {
        for channel in channels {
            let Some(declared) = config.declared.get(channel).copied() else { continue };
            let averaged = sigma_of_mean(declared.noise_sigma, used_s, &config);
            let error = match channel {
                Channel::Tc => {
                    expected_limit_error(declared.noise_sigma, soak_s, &config, settings).unwrap_or(averaged)
                }
                _ => averaged,
            };
            let left = DeclaredUncertainty { offset_sigma: sigma.hypot(error), ..declared };
            config.declared.insert(*channel, left);
        }
    }
    config
}

/// Standard error of the mean over `used_s` of a reading with the standard deviation `noise_sigma`. The white part of the noise averages
/// over hundreds of samples.
fn sigma_of_mean(noise_sigma: f64, used_s: f64, config: &IdentifyConfig) -> f64 {
    let colour = config.noise();
    noise_sigma * variance_of_mean(colour.first_order_variance_ratio(), used_s, colour.time_constant_s).sqrt()
}

/// Channels that read the same at standstill, and the non-uniformity of each group.
fn groups(settings: &ZeroSettings) -> [(&'static [Channel], f64); 2] {
    let [temperatures, pressures] = Soak::EQUAL_AT_REST;
    [(temperatures, settings.temperature_sigma_k), (pressures, settings.pressure_sigma_pa)]
}

/// Whether a shaft is slower than any running machine's, and hence at standstill.
fn is_at_rest(speed_rpm: f64) -> bool {
    speed_rpm.abs() < *plausible(Channel::ShaftSpeed).running.start()
}

/// The last standstill before the first step with a running machine. If steps were detected from the readings, the soak may count as a step.
fn at_rest(recording: &Recording) -> (f64, f64) {
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

/// Limit of the housing reading, K, from the last two thirds of the soak, and its standard error. `None` for a soak of less than ten minutes
/// and for a sensor without declared noise.
fn housing_limit(
    recording: &Recording,
    (start_s, end_s): (f64, f64),
    config: &IdentifyConfig,
    settings: &ZeroSettings,
) -> Option<(f64, f64)> {
    let first_s = start_s + (end_s - start_s) / SOAK_PARTS;
    let noise_sigma = config.declared.get(&Channel::Tc)?.noise_sigma;
    if end_s - start_s < settings.longest_s {
        return None;
    }
    let series = recording.series.get(&Channel::Tc)?;
    let (mut t_s, mut means, mut fewest) = (Vec::new(), Vec::new(), usize::MAX);
    for block in 0..((end_s - first_s) / TREND_BLOCK_S) as usize {
        let from_s = first_s + block as f64 * TREND_BLOCK_S;
        let (_, values) = series.slice(from_s, from_s + TREND_BLOCK_S);
        let usable = usable(Channel::Tc, values);
        let Some(mean) = mean(&usable) else { continue };
        t_s.push(from_s + 0.5 * TREND_BLOCK_S);
        means.push(mean);
        fewest = fewest.min(usable.len());
    }
    let variance = config.noise().variance_of_mean(fewest, TREND_BLOCK_S);
    relaxation::limit(&t_s, &means, noise_sigma * variance.sqrt())
}

/// The standard error of [`housing_limit`] after a soak of `soak_s`.
fn expected_limit_error(
    noise_sigma: f64,
    soak_s: f64,
    config: &IdentifyConfig,
    settings: &ZeroSettings,
) -> Option<f64> {
    if soak_s < settings.longest_s {
        return None;
    }
    let used_s = (SOAK_PARTS - 1.0) / SOAK_PARTS * soak_s;
    let t_s: Vec<f64> = (0..(used_s / TREND_BLOCK_S) as usize)
        .map(|block| soak_s - used_s + (block as f64 + 0.5) * TREND_BLOCK_S)
        .collect();
    let samples = (TREND_BLOCK_S / SAMPLE_INTERVAL_S) as usize;
    let variance = config.noise().variance_of_mean(samples, TREND_BLOCK_S);
    let relaxing: Vec<f64> = t_s.iter().map(|t_s| relaxation::usual_k(*t_s)).collect();
    relaxation::limit(&t_s, &relaxing, noise_sigma * variance.sqrt()).map(|(_, error)| error)
}

/// Reading of a sensor at standstill, K or Pa.
#[derive(Clone, Copy)]
struct Reading {
    channel: Channel,
    mean: f64,
    /// Remaining standard deviation of its offset.
    own: f64,
    /// The same with the declared offset.
    total: f64,
}

/// The common reading of the sensors.
fn common(readings: &[Reading]) -> f64 {
    let weight: f64 = readings.iter().map(|reading| reading.total.powi(-2)).sum();
    readings.iter().map(|reading| reading.mean * reading.total.powi(-2)).sum::<f64>() / weight
}

/// The plausible readings among some values.
fn usable(channel: Channel, values: &[f64]) -> Vec<f64> {
    values.iter().copied().filter(|value| is_reading(channel, *value)).collect()
}

struct SoakMean {
    mean: f64,
    drift_per_min: f64,
}

/// Mean of a channel over a segment, and its drift from the first to the last third.
fn soak_mean(recording: &Recording, channel: Channel, start_s: f64, end_s: f64) -> Option<SoakMean> {
    let series: &Series = recording.series.get(&channel)?;
    let third_s = (end_s - start_s) / SOAK_PARTS;
    let of = |start_s: f64, end_s: f64| mean(usable(channel, series.slice(start_s, end_s).1));
    let (early, late) = (of(start_s, start_s + third_s)?, of(end_s - third_s, end_s)?);
    Some(SoakMean { mean: of(start_s, end_s)?, drift_per_min: (late - early) / (2.0 * third_s / S_PER_MIN) })
}
