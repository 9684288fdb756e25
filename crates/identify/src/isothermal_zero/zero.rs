//! The isothermal zero: sensor offsets from a state in which all sensors must read the same.
//!
//! In a soak at standstill the shaft is stopped, and oil and cell have one temperature. T1, T2, Tc and T_oil then see one temperature,
//! P1 and P2 one pressure, P3 and P4 another. Their differences are offsets, up to the residual non-uniformity of the rig. A sensor that does not
//! rest yet keeps its declared offset: the gas at T1 and T2 rests within minutes, a housing within an hour. The common error is compared with
//! the cell's thermometer and barometer, and keeps the remaining uncertainty.

use crate::IdentifyConfig;
use crate::isothermal_zero::groups::{
    CORE, Group, HOT_SIDE, HOUSINGS, SHORTEST_SOAK_S, ZeroSettings, groups,
};
use crate::isothermal_zero::periodic::{self, PeriodicError};
use crate::isothermal_zero::references::{CellReference, cell_reading, compare};
use crate::isothermal_zero::soak_readings::{
    Reading, SOAK_PARTS, at_rest, combined_sigma, common, rests, soak_mean, usable,
};
use crate::step_data::samples::TREND_BLOCK_S;
use mapper_core::unit_factors::S_PER_MIN;
use mapper_core::{Channel, DeclaredUncertainty, Recording, SAMPLE_INTERVAL_S};
use mapper_numerics::coloured_noise::variance_of_mean;
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, mean};
use mapper_observe::declared::{CommonOffset, rest, usual_noise_sigma};
use mapper_physics::rig::sensor_fault::ExactReadings;
use serde::{Deserialize, Serialize, Serializer};
use std::collections::BTreeMap;

/// Time constant with which a drifting reading approaches its limit, min. Bound: the middle of those of stopped housings, 700 s.
const DRIFT_TIME_CONSTANT_MIN: f64 = 700.0 / S_PER_MIN;
/// Share of the distance between a housing and the common reading by which the gas at its probes may differ. Judgement: gas at rest in a pipe
/// flange of a warm housing; a thermometer five diameters away has the room's temperature to a tenth.
const WARM_HOUSING_SHARE: f64 = 0.1;

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
    /// Sensors that keep their declared offset, with the reason.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOutSensor>,
    /// Comparisons of the common readings with the cell's instruments.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<CellReference>,
    /// Periodic errors of readings at rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub periodic: Vec<PeriodicError>,
}

/// A sensor that a zero leaves out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOutSensor {
    /// The sensor.
    pub channel: Channel,
    /// Why it keeps its declared offset.
    pub reason: NotZeroed,
}

/// Why a sensor keeps its declared offset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum NotZeroed {
    #[error("still drifts by {drift_k_min:+.2} K/min")]
    Drifts { drift_k_min: f64 },
    #[error("its housing needs a soak of {needed_s:.0} s")]
    ShortSoak { needed_s: f64 },
    /// `off`: minus the common reading; `sigma`: expected standard deviation; K or Pa.
    #[error("reads {off:+.2} off the others, {:.1} times its declared offset", off.abs() / sigma)]
    Disagrees { off: f64, sigma: f64 },
    /// `sigma` of the zero, and the declared one, K or Pa.
    #[error("its declared offset, {declared:.2}, is better known than the zero, {sigma:.2}")]
    NoGain { sigma: f64, declared: f64 },
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

/// Finds the offsets of the temperatures against each other, of P1 and P2, and of P3 and P4.
///
/// Channels without a declared offset count as exact. Common temperature and pressure are means weighted by declared offset and
/// non-uniformity. Sensors that do not rest, or that do not agree although they are not T1, T2, P1 or P2, are left out. If a fault is allowed, a
/// temperature sensor that exceeds its declared offset is compared with the others; if two pressure taps differ by more, either may be wrong, so
/// both keep their declared offsets.
pub fn isothermal_zero(
    recording: &Recording,
    config: &IdentifyConfig,
    settings: &ZeroSettings,
) -> Result<IsothermalZero, NoZero> {
    let rest = at_rest(recording);
    let (start_s, end_s) = rest;
    let no_soak = NoZero::NoSoak { found_s: (end_s - start_s).max(0.0), needed_s: settings.shortest_s };
    if (end_s - start_s).is_nan() || end_s - start_s < settings.shortest_s {
        return Err(no_soak);
    }
    let start_s = end_s - used_s(end_s - start_s, settings);
    let periodic = periodic::find(recording, config, (start_s, end_s));
    let mut zero = IsothermalZero { start_s, end_s, periodic, ..IsothermalZero::default() };
    let soak = SoakReadings { recording, config, settings, rest, used: (start_s, end_s) };
    for group in groups(settings) {
        let readings = soak.gaining(&group, &mut zero.left_out);
        let Some((common, readings)) = soak.agreeing(&group, readings, &mut zero.left_out)? else { continue };
        let sigma = combined_sigma(&readings);
        let (mut shift, mut common_sigma) = (0.0, sigma);
        if group.has_reference
            && let Some(reference) =
                compare(recording, config, (start_s, end_s), group.channels[0], common, sigma)
        {
            (shift, common_sigma) = (reference.correction, reference.common_sigma);
            zero.references.push(reference);
        }
        for reading in &readings {
            // The error that P3 and P4 share is part of the remaining error of each.
            let left = if group.has_reference { reading.own } else { reading.own.hypot(sigma) };
            zero.offsets.insert(reading.channel, reading.mean - common + shift);
            zero.left_sigma.insert(reading.channel, left);
        }
        if group.has_reference {
            let channels = readings.iter().map(|reading| reading.channel).collect();
            zero.common.push(CommonOffset { channels, sigma: common_sigma, reading: common - shift });
        }
    }
    // T1 and T2 must read the same; if only pressures rest, the reason of the temperatures is the reason of the whole.
    if zero.offsets.is_empty() {
        let drifting = zero.left_out.iter().find_map(|left| match left.reason {
            NotZeroed::Drifts { drift_k_min } => Some((left.channel, drift_k_min)),
            _ => None,
        });
        return Err(drifting.map_or(no_soak, |(channel, drift_k_min)| NoZero::Drifts {
            channel,
            drift_k_min,
            limit_k_min: settings.drift_k_min,
        }));
    }
    Ok(zero)
}

/// Sensors that must read the same in a standstill.
pub(crate) struct AtRest {
    /// The part of the standstill that is compared, s.
    pub(crate) used_s: (f64, f64),
    /// Whether a zero may use it: it is the last one before the first step, and long enough.
    pub(crate) is_soak: bool,
    /// What rests.
    pub(crate) readings: Vec<Reading>,
    /// Reading of the cell's instrument and its standard deviation.
    pub(crate) cell: Option<(f64, f64)>,
}

/// The comparable readings of every standstill, each group of sensors by itself.
pub(crate) fn all_at_rest(recording: &Recording, config: &IdentifyConfig) -> Vec<AtRest> {
    let settings = ZeroSettings { shortest_s: 0.0, ..ZeroSettings::default() };
    let soak_start_s = at_rest(recording).0;
    let of_rest = |rest: (f64, f64)| {
        let (length_s, start_s) = (rest.1 - rest.0, rest.1 - used_s(rest.1 - rest.0, &settings));
        let used = (start_s, rest.1);
        let soak = SoakReadings { recording, config, settings: &settings, rest, used };
        let of_group = |group: Group| {
            let mut readings = soak.resting(&group, &mut Vec::new());
            if group.drift_limit_per_min.is_some() {
                soak.widen_heated(&mut readings);
            }
            let dimension = group.channels[0].info().dimension;
            let cell =
                group.has_reference.then(|| cell_reading(recording, config, used, dimension)).flatten();
            let is_soak = rest.0 == soak_start_s && length_s >= SHORTEST_SOAK_S;
            AtRest { used_s: used, is_soak, readings, cell }
        };
        groups(&settings).map(of_group)
    };
    rests(recording).into_iter().flat_map(of_rest).collect()
}

/// Length of the segment at the end of a soak that is used, s: half of it, since the first half settles, within the limits of the settings.
fn used_s(soak_s: f64, settings: &ZeroSettings) -> f64 {
    (0.5 * soak_s).min(settings.longest_s).max(settings.shortest_s)
}

struct SoakReadings<'a> {
    recording: &'a Recording,
    config: &'a IdentifyConfig,
    settings: &'a ZeroSettings,
    /// The whole standstill, s.
    rest: (f64, f64),
    /// Its used part, s.
    used: (f64, f64),
}

impl SoakReadings<'_> {
    /// The readings of a group that rest; the others are appended to `left_out`.
    fn resting(&self, group: &Group, left_out: &mut Vec<LeftOutSensor>) -> Vec<Reading> {
        let mut readings = Vec::new();
        for channel in group.channels {
            match self.reading(group, *channel) {
                Some(Ok(reading)) => readings.push(reading),
                Some(Err(reason)) => left_out.push(LeftOutSensor { channel: *channel, reason }),
                None => {}
            }
        }
        if group.drift_limit_per_min.is_some() {
            self.widen_drifting(group, &mut readings);
        }
        let warm = |housing: Channel| {
            let t1 = readings.iter().find(|reading| reading.channel == Channel::T1)?.mean;
            let of = soak_mean(self.recording, housing, self.used.0, self.used.1)?;
            let declared = self.config.sensor(housing).offset_sigma;
            Some(WARM_HOUSING_SHARE * ((of.mean - t1).abs() - EXCLUDE_SIGMAS * declared).max(0.0))
        };
        // If a fault is allowed, a housing that reads too high may be at fault.
        let is_judged = !self.settings.allows_a_fault;
        let [compressor_k, turbine_k] = [Channel::Tc, Channel::Tt]
            .map(|housing| if is_judged { warm(housing).unwrap_or(0.0) } else { 0.0 });
        for reading in &mut readings {
            match reading.channel {
                Channel::T1 | Channel::T2 => reading.widen(compressor_k),
                Channel::T3 | Channel::T4 => reading.widen(turbine_k),
                _ => {}
            }
        }
        readings
    }

    /// Those of them by which a zero gains: one that is less certain than the declaration is none.
    fn gaining(&self, group: &Group, left_out: &mut Vec<LeftOutSensor>) -> Vec<Reading> {
        let mut readings = self.resting(group, left_out);
        readings.retain(|reading| {
            let declared = self.config.sensor(reading.channel).offset_sigma;
            let improves = declared == 0.0 || reading.own < declared;
            if !improves {
                let reason = NotZeroed::NoGain { sigma: reading.own, declared };
                left_out.push(LeftOutSensor { channel: reading.channel, reason });
            }
            improves
        });
        readings
    }

    /// Adds the distance of their sources of heat to the readings of housings. Leaves out the oil, which may be heated, and Tc if the oil is not
    /// known. Without T1 and T2 nothing shows what rests.
    fn widen_heated(&self, readings: &mut Vec<Reading>) {
        let gas = readings.iter().filter(|reading| matches!(reading.channel, Channel::T1 | Channel::T2));
        let Some(gas_k) = mean(gas.map(|reading| reading.mean)) else { return readings.clear() };
        let distance_k = |source: Channel| {
            let of = soak_mean(self.recording, source, self.used.0, self.used.1)?;
            let declared = self.config.sensor(source).offset_sigma;
            Some(((of.mean - gas_k).abs() - EXCLUDE_SIGMAS * declared).max(0.0))
        };
        let (oil_k, turbine_k) = (distance_k(Channel::TOil), distance_k(Channel::Tt).unwrap_or(0.0));
        readings.retain_mut(|reading| {
            match reading.channel {
                Channel::Tc => reading.widen(oil_k.unwrap_or(0.0).max(turbine_k)),
                Channel::Tt => reading.widen(oil_k.unwrap_or(0.0)),
                _ => {}
            }
            reading.channel != Channel::TOil && (reading.channel != Channel::Tc || oil_k.is_some())
        });
    }

    /// The reading of a channel at rest, or why it does not rest; `None` if it is not recorded, or not declared although only a declaration makes
    /// it a member.
    fn reading(&self, group: &Group, channel: Channel) -> Option<Result<Reading, NotZeroed>> {
        let (start_s, end_s) = self.used;
        let reading = soak_mean(self.recording, channel, start_s, end_s)?;
        let declared = self.config.sensor(channel);
        if HOT_SIDE.contains(&channel) && declared.offset_sigma <= 0.0 {
            return None;
        }
        let noise_sigma =
            if declared.noise_sigma > 0.0 { declared.noise_sigma } else { usual_noise_sigma(channel) };
        let mut mean = reading.mean;
        let mut own = group.sigma.hypot(sigma_of_mean(declared.noise_sigma, end_s - start_s, self.config));
        if group.drift_limit_per_min.is_some_and(|limit| reading.drift_per_min.abs() > limit) {
            return Some(Err(NotZeroed::Drifts { drift_k_min: reading.drift_per_min }));
        }
        // A housing reaches the cell's temperature last, and its drift may be below the threshold.
        if HOUSINGS.contains(&channel) {
            let needed_s = self.settings.longest_s;
            let Some((limit, error)) = self.housing_limit(channel, noise_sigma) else {
                return Some(Err(NotZeroed::ShortSoak { needed_s }));
            };
            (mean, own) = (limit, group.sigma.hypot(error));
        }
        let third_s = (end_s - start_s) / SOAK_PARTS;
        let of_third = sigma_of_mean(noise_sigma, third_s, self.config);
        let drift_sigma = std::f64::consts::SQRT_2 * of_third / (2.0 * third_s / S_PER_MIN);
        let gain_sigma = declared.gain_sigma_ratio * ExactReadings::default().gain_error(channel, mean);
        let total = own.hypot(declared.offset_sigma).hypot(gain_sigma);
        let drift_per_min = reading.drift_per_min;
        Some(Ok(Reading { channel, mean, own, total, drift_per_min, drift_sigma }))
    }

    /// Adds the distance from their limits to readings that drift against T1 and T2. If the air of the cell drifts, all of them do.
    fn widen_drifting(&self, group: &Group, readings: &mut [Reading]) {
        let core: Vec<Reading> =
            readings.iter().copied().filter(|reading| group.is_core(reading.channel)).collect();
        let Some(of_core) = mean(core.iter().map(|reading| reading.drift_per_min)) else { return };
        let sigma_of_core =
            core.iter().map(|reading| reading.drift_sigma).fold(0.0, f64::hypot) / core.len() as f64;
        for reading in readings.iter_mut().filter(|reading| !HOUSINGS.contains(&reading.channel)) {
            let drift = reading.drift_per_min - of_core;
            if drift.abs() > EXCLUDE_SIGMAS * reading.drift_sigma.hypot(sigma_of_core) {
                reading.widen(DRIFT_TIME_CONSTANT_MIN * drift);
            }
        }
    }

    /// The common reading and the sensors that agree with it; `None` if fewer than two remain.
    fn agreeing(
        &self,
        group: &Group,
        mut readings: Vec<Reading>,
        left_out: &mut Vec<LeftOutSensor>,
    ) -> Result<Option<(f64, Vec<Reading>)>, NoZero> {
        let is_core = |reading: &Reading| group.is_core(reading.channel);
        let allows_a_fault = self.settings.allows_a_fault;
        // With one of T1 and T2 nothing shows that the other rests.
        if readings.iter().filter(|reading| is_core(reading)).count() < CORE {
            return Ok(None);
        }
        let core: Vec<Reading> = readings.iter().copied().filter(is_core).collect();
        let core_common = (common(&core), combined_sigma(&core));
        let may_be_at_fault =
            |reading: &Reading| is_core(reading) || allows_a_fault && !HOT_SIDE.contains(&reading.channel);
        readings.retain(|reading| {
            let (off, sigma) = (reading.mean - core_common.0, reading.total.hypot(core_common.1));
            let agrees = may_be_at_fault(reading) || off.abs() <= EXCLUDE_SIGMAS * sigma;
            if !agrees {
                let reason = NotZeroed::Disagrees { off, sigma };
                left_out.push(LeftOutSensor { channel: reading.channel, reason });
            }
            agrees
        });
        let mut common = common(&readings);
        if !common.is_finite() {
            return Ok(None);
        }
        let uneven = |common: f64, at_fault: Option<Channel>| {
            let mut fault_free = readings.iter().filter(|reading| Some(reading.channel) != at_fault);
            fault_free.find(|reading| (reading.mean - common).abs() > EXCLUDE_SIGMAS * reading.total)
        };
        if let Some(first) = uneven(common, None) {
            let Reading { channel, mean, total, .. } = *first;
            let refused = NoZero::Uneven { channel, off: mean - common, sigma: total };
            // P3 and P4 are no reason to refuse the zero of the compressor's sensors.
            if !allows_a_fault && group.has_reference {
                return Err(refused);
            }
            if readings.len() < 3 {
                return Ok(None);
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
            let Some((at_fault, of_others, _)) = tried.min_by(|a, b| a.2.total_cmp(&b.2)) else {
                return Ok(None);
            };
            if uneven(of_others, Some(at_fault)).is_some() {
                return Err(refused);
            }
            common = of_others;
        }
        Ok(Some((common, readings)))
    }

    /// Limit of a housing's reading, K, from the last two thirds of the soak, and its standard error. `None` for a soak of less than ten minutes.
    fn housing_limit(&self, channel: Channel, noise_sigma: f64) -> Option<(f64, f64)> {
        let (start_s, end_s) = self.rest;
        let first_s = start_s + (end_s - start_s) / SOAK_PARTS;
        if end_s - start_s < self.settings.longest_s {
            return None;
        }
        let series = self.recording.series.get(&channel)?;
        let (mut t_s, mut means, mut fewest) = (Vec::new(), Vec::new(), usize::MAX);
        for block in 0..((end_s - first_s) / TREND_BLOCK_S) as usize {
            let from_s = first_s + block as f64 * TREND_BLOCK_S;
            let (_, values) = series.slice(from_s, from_s + TREND_BLOCK_S);
            let usable = usable(channel, values);
            let Some(mean) = mean(&usable) else { continue };
            t_s.push(from_s + 0.5 * TREND_BLOCK_S);
            means.push(mean);
            fewest = fewest.min(usable.len());
        }
        let variance = self.config.noise().variance_of_mean(fewest, TREND_BLOCK_S);
        periodic::limit(&t_s, &means, noise_sigma * variance.sqrt())
    }
}

/// The recording without the offsets, and the configuration with the remaining uncertainty as declared offset: prior of the joint method, bias
/// of the others.
pub fn zeroed(
    mut recording: Recording,
    mut config: IdentifyConfig,
    zero: &IsothermalZero,
) -> (Recording, IdentifyConfig) {
    config.exact_at = rest(&zero.common);
    for common in &zero.common {
        add_common_error(&mut config, &common.channels, common.sigma);
    }
    for error in &zero.periodic {
        if let Some(declared) = config.declared.get(&error.channel).copied() {
            let widened = error.widen(declared, &config, config.thresholds.end_mean_s);
            config.declared.insert(error.channel, widened);
        }
    }
    for (channel, offset) in &zero.offsets {
        if let Some(series) = recording.series.get_mut(channel) {
            series.values.iter_mut().for_each(|value| *value -= offset);
        }
        if let (Some(declared), Some(left)) = (config.declared.get_mut(channel), zero.left_sigma.get(channel))
        {
            config.offsets_before_zero.insert(*channel, declared.offset_sigma);
            *declared = DeclaredUncertainty { offset_sigma: *left, ..*declared };
        }
    }
    (recording, config)
}

/// Adds the error that all thermometers, or P1 and P2, share after a zero.
fn add_common_error(config: &mut IdentifyConfig, channels: &[Channel], sigma: f64) {
    if channels.contains(&Channel::P1) {
        config.barometer_sigma_pa = config.barometer_sigma_pa.hypot(sigma);
    }
    if channels.contains(&Channel::T1) {
        config.thermometer_sigma_k = config.thermometer_sigma_k.hypot(sigma);
    }
}

/// Predicts the remaining offset uncertainty after a zero of `soak_s` with these readings at rest.
pub fn expected_after_zero(
    mut config: IdentifyConfig,
    settings: &ZeroSettings,
    soak_s: f64,
    rest: ExactReadings,
) -> IdentifyConfig {
    config.exact_at = rest;
    let used_s = used_s(soak_s, settings);
    for group in groups(settings) {
        let mut members = Vec::new();
        for channel in group.channels {
            let Some(declared) = config.declared.get(channel).copied() else { continue };
            let error = match channel {
                Channel::Tc | Channel::Tt => {
                    expected_limit_error(declared.noise_sigma, soak_s, &config, settings)
                }
                // Whether the gas of the turbine has settled is only known afterwards.
                channel if HOT_SIDE.contains(channel) => None,
                _ => Some(sigma_of_mean(declared.noise_sigma, used_s, &config)),
            };
            let left = error.map(|error| group.sigma.hypot(error));
            let Some(left) = left.filter(|left| *left < declared.offset_sigma) else { continue };
            let total = left.hypot(declared.offset_sigma);
            members.push(Reading { channel: *channel, own: left, total, ..Reading::of(*channel) });
            config.declared.insert(*channel, DeclaredUncertainty { offset_sigma: left, ..declared });
        }
        let channels: Vec<Channel> = members.iter().map(|member| member.channel).collect();
        if channels.len() >= CORE {
            add_common_error(&mut config, &channels, combined_sigma(&members));
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

/// The standard error of the limit of a housing after a soak of `soak_s`.
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
    let relaxing: Vec<f64> = t_s.iter().map(|t_s| periodic::usual_k(*t_s)).collect();
    periodic::limit(&t_s, &relaxing, noise_sigma * variance.sqrt()).map(|(_, error)| error)
}

/// Whether offsets were subtracted from a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ZeroOutcome {
    /// Offsets were subtracted.
    Found(IsothermalZero),
    /// A zero was requested but the recording has none; the declared offsets remain.
    Refused(NoZero),
    /// No zero was requested.
    #[default]
    NotRequested,
}

impl ZeroOutcome {
    /// Searches for the zero of a recording, if one was requested.
    pub fn of(recording: &Recording, config: &IdentifyConfig, settings: Option<ZeroSettings>) -> Self {
        let Some(settings) = settings else { return ZeroOutcome::NotRequested };
        isothermal_zero(recording, config, &settings).map_or_else(ZeroOutcome::Refused, ZeroOutcome::Found)
    }

    /// The zero, if one was found.
    pub fn found(&self) -> Option<&IsothermalZero> {
        if let ZeroOutcome::Found(zero) = self { Some(zero) } else { None }
    }

    /// Subtracts the offsets from a recording, and declares their remaining uncertainty in the configuration; both are unchanged if no zero
    /// was found.
    pub fn subtract(&self, recording: Recording, config: IdentifyConfig) -> (Recording, IdentifyConfig) {
        match self {
            ZeroOutcome::Found(zero) => zeroed(recording, config, zero),
            ZeroOutcome::Refused(_) | ZeroOutcome::NotRequested => (recording, config),
        }
    }
}

/// Offsets and their remaining uncertainty, K or Pa, with their segment; `{"refused": reason}`, or `null` if none was requested.
impl Serialize for ZeroOutcome {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Refused {
            refused: String,
        }
        match self {
            ZeroOutcome::Found(zero) => zero.serialize(serializer),
            ZeroOutcome::Refused(reason) => Refused { refused: reason.to_string() }.serialize(serializer),
            ZeroOutcome::NotRequested => serializer.serialize_unit(),
        }
    }
}
