//! Variation of flow and pressure from one tenth of a second to the next, and the readings that a search for surge needs; the surge flow
//! extrapolated from the growth of the variation, and the next move of a search.

use mapper_core::{
    Channel, ChannelColumn, FastSamples, Recording, ReferenceState, SampleBatch, SoftSurge, StepMarker,
    SurgeSearchSettings,
};
use mapper_numerics::statistics::mean;
use mapper_physics::compressor_map::closed_form_map;
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, VecDeque};

/// Length of the segments that are detrended by a straight line, s. Drift is not due to surge, and slow sampling may fold fast
/// oscillations to low frequencies.
const SEGMENT_S: f64 = 5.0;
const MIN_SAMPLES: usize = 10;
/// Maximum lag of the autocorrelation, in samples; smaller than a segment.
const MAX_LAG_SAMPLES: usize = 6;
const MIN_SEGMENTS: usize = 1;

/// A variance with its degrees of freedom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variation {
    /// Variance, square of the channel's unit.
    pub variance: f64,
    /// Number of independent degrees of freedom with the same accuracy.
    pub degrees_of_freedom: f64,
}

impl Variation {
    /// The variation of samples; `None` if there are too few.
    pub fn of(t_s: &[f64], values: &[f64]) -> Option<Self> {
        let first_s = *t_s.first()?;
        let mut segments: Vec<Vec<f64>> = Vec::new();
        let mut from = 0;
        while from < t_s.len() {
            let segment = ((t_s[from] - first_s) / SEGMENT_S).floor();
            let count =
                t_s[from..].partition_point(|t| ((t - first_s) / SEGMENT_S).floor() <= segment).max(1);
            let to = from + count;
            if count >= MIN_SAMPLES {
                segments.push(detrend(&t_s[from..to], &values[from..to]));
            }
            from = to;
        }
        if segments.len() < MIN_SEGMENTS {
            return None;
        }
        let samples = segments.iter().map(Vec::len).sum::<usize>() as f64;
        let freedom = samples - 2.0 * segments.len() as f64;
        let lagged = |lag: usize| -> f64 {
            segments.iter().flat_map(|segment| segment.iter().zip(&segment[lag..]).map(|(a, b)| a * b)).sum()
        };
        let square = lagged(0);
        // Bartlett: correlated samples add less information about the variance. Chance alone makes the square of a
        // correlation 1/n.
        let memory: f64 =
            (1..=MAX_LAG_SAMPLES).map(|lag| ((lagged(lag) / square).powi(2) - 1.0 / samples).max(0.0)).sum();
        (square > 0.0).then_some(Variation {
            variance: square / freedom,
            degrees_of_freedom: freedom / (1.0 + 2.0 * memory),
        })
    }
}

/// Residual of the samples about their regression line.
fn detrend(t_s: &[f64], values: &[f64]) -> Vec<f64> {
    let count = t_s.len() as f64;
    let middle_s = t_s.iter().sum::<f64>() / count;
    let level = values.iter().sum::<f64>() / count;
    let (mut across, mut along) = (0.0, 0.0);
    for (t, value) in t_s.iter().zip(values) {
        across += (t - middle_s) * (value - level);
        along += (t - middle_s).powi(2);
    }
    let slope = if along > 0.0 { across / along } else { 0.0 };
    t_s.iter().zip(values).map(|(t, value)| value - level - slope * (t - middle_s)).collect()
}

/// Flows and pressure ratios at one speed, in the order of the readings.
#[derive(Debug, Clone)]
pub(crate) struct SmoothedFlow {
    /// Corrected flow at the speed of the last reading, kg/s.
    flows_kg_s: Vec<f64>,
    /// Relative standard error of the smoothed flow, from the scatter about the curve.
    flow_error_ratio: f64,
}

/// Range of openings above the smallest one that is fitted: beyond it a parabola does not describe a valve.
const REACH_RATIO: f64 = 1.7;

impl SmoothedFlow {
    /// Flows converted to the speed of the last reading by similarity, then smoothed by a parabola of the logarithm of flow over
    /// the logarithm of the opening. With fewer than five readings the flows are as measured.
    fn fit(readings: &[SurgeReading]) -> Option<Self> {
        let last = readings.last()?;
        let to_speed = |reading: &SurgeReading| {
            reading.flow_corrected_kg_s * last.speed_corrected_rpm / reading.speed_corrected_rpm
        };
        let measured: Vec<f64> = readings.iter().map(to_speed).collect();
        let log_distance =
            |reading: &SurgeReading| (reading.valve_opening_ratio / last.valve_opening_ratio).ln();
        let is_near = |reading: &SurgeReading| log_distance(reading).abs() < REACH_RATIO.ln();
        let (mut square, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let mut count = 0usize;
        for (reading, flow) in readings.iter().zip(&measured).filter(|(reading, _)| is_near(reading)) {
            let row = row(log_distance(reading));
            square += row * row.transpose();
            right += row * flow.ln();
            count += 1;
        }
        let unsmoothed = SmoothedFlow { flows_kg_s: measured.clone(), flow_error_ratio: 0.0 };
        let (true, Some(inverse)) = (count >= 5, square.try_inverse()) else { return Some(unsmoothed) };
        let parabola = inverse * right;
        let flow = |reading: &SurgeReading| row(log_distance(reading)).dot(&parabola);
        let pairs = || readings.iter().zip(&measured).filter(|(reading, _)| is_near(reading));
        let residual: f64 = pairs().map(|(reading, measured)| (measured.ln() - flow(reading)).powi(2)).sum();
        let sigma_ratio = (residual / (count - 3).max(1) as f64).sqrt();
        let at_last = row(0.0);
        let flows_kg_s = readings
            .iter()
            .zip(&measured)
            .map(|(reading, measured)| if is_near(reading) { flow(reading).exp() } else { *measured })
            .collect();
        let flow_error_ratio = sigma_ratio * at_last.dot(&(inverse * at_last)).max(0.0).sqrt();
        Some(SmoothedFlow { flows_kg_s, flow_error_ratio })
    }
}

fn row(log_distance: f64) -> Vector3<f64> {
    Vector3::new(1.0, log_distance, log_distance * log_distance)
}

/// Soft surge of a line: where the variation of a pressure has grown by `growth_ratio`, between two openings. `None` without fast samples, and if
/// it has not grown.
pub(crate) fn soft_surge(readings: &[SurgeReading], growth_ratio: f64) -> Option<SoftSurge> {
    let fast: Vec<(&SurgeReading, f64)> =
        readings.iter().filter_map(|reading| Some((reading, reading.fast_variation?.1))).collect();
    let (channel, _) = readings.iter().find_map(|reading| reading.fast_variation)?;
    let quiet_ratio = mean(fast.iter().take(QUIET_READINGS).map(|(_, ratio)| *ratio))?;
    let variation_ratio = growth_ratio * quiet_ratio;
    let last = readings.last()?;
    // One value beyond may be chance.
    let stays = |from: usize| fast[from..].iter().all(|(_, ratio)| *ratio >= variation_ratio);
    let first = (1..fast.len()).find(|index| stays(*index) && fast.len() - index > 1)?;
    let (far, near) = (fast[first - 1], fast[first]);
    let share = ((variation_ratio / far.1).ln() / (near.1 / far.1).ln()).clamp(0.0, 1.0);
    let place = |reading: &SurgeReading| {
        let factor = last.speed_corrected_rpm / reading.speed_corrected_rpm;
        closed_form_map::at_speed(reading.flow_corrected_kg_s, reading.pressure_ratio, factor)
    };
    let (from, to) = (place(far.0), place(near.0));
    Some(SoftSurge {
        channel,
        variation_ratio,
        quiet_ratio,
        flow_corrected_kg_s: from.0 + share * (to.0 - from.0),
        pressure_ratio: from.1 + share * (to.1 - from.1),
    })
}

/// Channels whose variation indicates surge.
pub const PRECURSOR_CHANNELS: [Channel; 3] = [Channel::P2, Channel::CompressorFlow, Channel::P1];

/// Means and variation at one opening.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurgeReading {
    /// Valve opening relative to the nominal area.
    pub valve_opening_ratio: f64,
    /// Run time of its end, s.
    pub end_s: f64,
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Physical speed, rpm.
    pub speed_rpm: f64,
    /// Corrected flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio P2/P1.
    pub pressure_ratio: f64,
    /// Total inlet pressure P1, Pa.
    pub p1_pa: f64,
    /// Variation of [`PRECURSOR_CHANNELS`]; `None` if a channel has too few samples.
    pub variations: [Option<Variation>; PRECURSOR_CHANNELS.len()],
    /// Coefficient of variation of P2, or else of P1, from fast samples.
    pub fast_variation: Option<(Channel, f64)>,
}

impl SurgeReading {
    /// The reading of a step, from [`SurgeSearchSettings::SETTLE_S`] after its start on. `None` if a mean or every variation is unknown:
    /// the step was too short, or a channel is missing.
    pub fn of(recording: &Recording, step: &StepMarker, reference: ReferenceState) -> Option<Self> {
        let samples = |channel: Channel| -> Option<(Vec<f64>, Vec<f64>)> {
            let series = recording.series.get(&channel)?;
            let (t_s, values) = series.slice(step.start_s + SurgeSearchSettings::SETTLE_S, step.end_s);
            Some(t_s.iter().zip(values).filter(|(_, value)| value.is_finite()).unzip())
        };
        let level = |channel: Channel| mean(&samples(channel)?.1).filter(|level| *level > 0.0);
        let (speed_rpm, flow_kg_s) = (level(Channel::ShaftSpeed)?, level(Channel::CompressorFlow)?);
        let (t1_k, p1_pa, p2_pa) = (level(Channel::T1)?, level(Channel::P1)?, level(Channel::P2)?);
        let variations = PRECURSOR_CHANNELS.map(|channel| {
            let (t_s, values) = samples(channel)?;
            Variation::of(&t_s, &values)
        });
        let fast_variation = [Channel::P2, Channel::P1]
            .into_iter()
            .find_map(|channel| Some((channel, mean(&samples(channel.variation()?)?.1)?)));
        variations.iter().any(Option::is_some).then_some(SurgeReading {
            fast_variation,
            valve_opening_ratio: step.valve_opening_ratio,
            end_s: step.end_s,
            speed_corrected_rpm: reference.corrected_speed_rpm(speed_rpm, t1_k),
            speed_rpm,
            flow_corrected_kg_s: reference.corrected_flow_kg_s(flow_kg_s, t1_k, p1_pa),
            pressure_ratio: p2_pa / p1_pa,
            p1_pa,
            variations,
        })
    }
}

/// Exponents of the growth of the variance with the inverse margin, with their prior probabilities: theory predicts 1, and rigs
/// differ.
const EXPONENTS: [(f64, f64); 5] = [(0.8, 0.1), (0.9, 0.2), (1.0, 0.4), (1.12, 0.2), (1.25, 0.1)];
/// Margins at which the growth may begin, with equal prior probability; the first one means growth everywhere.
const ONSETS: [f64; 8] = [10.0, 0.5, 0.35, 0.28, 0.22, 0.17, 0.13, 0.1];
/// Candidate surge flows below the smallest measured flow: smallest and largest relative distance, and their number. The prior
/// is uniform in the logarithm of the distance.
const DISTANCES: (f64, f64, usize) = (1e-3, 0.4, 90);
/// Readings at the start of an approach that are far from surge: they define the quiet level.
const QUIET_READINGS: usize = 3;
/// Minimum number of readings with significant growth before the law is extrapolated.
const MIN_GROWN: usize = 3;
/// Minimum ratio of the largest variance to the quiet level: the onset of growth alone resembles a distant surge.
const MIN_GROWTH_RATIO: f64 = 6.0;
/// Log-likelihood ratio of growth to the quiet level above which growth is significant: chance exceeds it once in some thousand
/// readings.
const MIN_EXCESS: f64 = 7.0;

/// Standard error of the distance to surge due to the law itself, ratio: no rig follows it exactly.
const LAW_ERROR_RATIO: f64 = 0.25;

/// Estimate of the surge flow of a line, at the speed of its last reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurgeEstimate {
    /// Corrected flow at surge, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Its standard error without the flow meter's gain, kg/s.
    pub standard_error_kg_s: f64,
    /// The surge flow lies above this with a probability of 2 %, kg/s.
    pub highest_flow_kg_s: f64,
    /// Smallest corrected flow so far, kg/s.
    pub closest_flow_kg_s: f64,
    /// Whether the variation has grown enough, at enough readings; otherwise the other values have little meaning.
    pub is_usable: bool,
    /// Whether the variation has begun to grow, at any number of readings.
    pub has_growth: bool,
}

impl SurgeEstimate {
    /// The estimate from readings at decreasing openings; `None` for fewer than four.
    pub fn of(readings: &[SurgeReading]) -> Option<Self> {
        if readings.len() < 4 {
            return None;
        }
        let SmoothedFlow { flows_kg_s, flow_error_ratio } = SmoothedFlow::fit(readings)?;
        let closest_flow_kg_s = flows_kg_s.iter().copied().fold(f64::INFINITY, f64::min);
        let levels: Vec<Option<f64>> =
            (0..PRECURSOR_CHANNELS.len()).map(|channel| quiet_variance(readings, channel)).collect();
        let is_significant = |reading: &SurgeReading| {
            let channels = reading.variations.iter().zip(&levels);
            channels.filter_map(|(read, level)| Some(log_likelihood_excess((*read)?, (*level)?))).sum::<f64>()
                > MIN_EXCESS
        };
        let has_large_growth = |reading: &SurgeReading| {
            let mut channels = reading.variations.iter().zip(&levels);
            channels.any(|(read, level)| {
                read.zip(*level).is_some_and(|(read, level)| read.variance >= MIN_GROWTH_RATIO * level)
            })
        };
        let significant_readings =
            readings.iter().rev().take_while(|reading| is_significant(reading)).count();
        let candidates = candidates(closest_flow_kg_s);
        let mut logs: Vec<(usize, f64)> = Vec::new();
        for (candidate, surge_kg_s) in candidates.iter().enumerate() {
            for (exponent, weight) in EXPONENTS {
                for onset_ratio in ONSETS {
                    let law = GrowthLaw { exponent, onset_ratio };
                    let parts: Vec<f64> =
                        flows_kg_s.iter().map(|flow| law.growth_at(flow / surge_kg_s - 1.0)).collect();
                    let channel = |channel: usize| -> f64 {
                        let read: Vec<Observation> = parts
                            .iter()
                            .zip(readings)
                            .filter_map(|(part, reading)| Some((*part, reading.variations[channel]?)))
                            .collect();
                        if read.is_empty() { 0.0 } else { log_likelihood(&read) }
                    };
                    let log: f64 = (0..PRECURSOR_CHANNELS.len()).map(channel).sum();
                    logs.push((candidate, log + f64::ln(weight)));
                }
            }
        }
        let best = logs.iter().map(|(_, log)| *log).fold(f64::NEG_INFINITY, f64::max);
        let mut weights = vec![0.0; candidates.len()];
        for (candidate, log) in logs {
            weights[candidate] += (log - best).exp();
        }
        let total_weight: f64 = weights.iter().sum();
        let mean_flow_kg_s =
            candidates.iter().zip(&weights).map(|(flow, w)| flow * w).sum::<f64>() / total_weight;
        let variance =
            candidates.iter().zip(&weights).map(|(flow, w)| (flow - mean_flow_kg_s).powi(2) * w).sum::<f64>()
                / total_weight;
        // Candidates are ordered from the highest flow to the lowest.
        let mut cumulated_weight = 0.0;
        let highest = candidates.iter().zip(&weights).find(|(_, weight)| {
            cumulated_weight += **weight;
            cumulated_weight >= 0.02 * total_weight
        });
        Some(SurgeEstimate {
            flow_corrected_kg_s: mean_flow_kg_s,
            standard_error_kg_s: variance
                .sqrt()
                .hypot(flow_error_ratio * mean_flow_kg_s)
                .hypot(LAW_ERROR_RATIO * (closest_flow_kg_s - mean_flow_kg_s)),
            highest_flow_kg_s: highest.map_or(closest_flow_kg_s, |(flow, _)| *flow),
            closest_flow_kg_s,
            is_usable: significant_readings >= MIN_GROWN && readings.last().is_some_and(has_large_growth),
            has_growth: significant_readings > 0,
        })
    }

    /// Standard error over the flow itself, ratio.
    pub fn standard_error_ratio(&self) -> f64 {
        self.standard_error_kg_s / self.flow_corrected_kg_s
    }
}

fn quiet_variance(readings: &[SurgeReading], channel: usize) -> Option<f64> {
    let quiet: Vec<f64> = readings
        .iter()
        .take(QUIET_READINGS)
        .filter_map(|reading| Some(reading.variations[channel]?.variance))
        .collect();
    mean(&quiet)
}

/// Candidate surge flows, from the highest down, kg/s.
fn candidates(closest_flow_kg_s: f64) -> Vec<f64> {
    let (min, max, count) = DISTANCES;
    let step = (max / min).ln() / (count - 1) as f64;
    (0..count).map(|i| closest_flow_kg_s * (1.0 - min * (step * i as f64).exp())).collect()
}

/// Dependence of the growing part on the surge margin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GrowthLaw {
    /// The variance is proportional to the inverse of the margin to this power: 1 by theory.
    exponent: f64,
    /// Margin at which the growth begins.
    onset_ratio: f64,
}

impl GrowthLaw {
    /// The growing part at a margin, without its scale factor.
    fn growth_at(self, margin_ratio: f64) -> f64 {
        let part = |margin: f64| margin.max(1e-6).powf(-self.exponent);
        (part(margin_ratio) - part(self.onset_ratio)).max(0.0)
    }
}

/// The growing part without its scale factor, and the measured variation at that reading.
pub(crate) type Observation = (f64, Variation);

/// Iterations of the reweighted fit; the variance then changes by less than its own error.
const ROUNDS: usize = 5;

/// Log-likelihood of a channel's variations at the most likely non-negative level and size. A variance follows a chi-squared
/// distribution with its degrees of freedom.
fn log_likelihood(read: &[Observation]) -> f64 {
    let level_min = 0.2 * read.iter().map(|(_, v)| v.variance).fold(f64::INFINITY, f64::min);
    let mut expected: Vec<f64> = read.iter().map(|(_, variation)| variation.variance).collect();
    for _ in 0..ROUNDS {
        // Weighted least squares; the weights are inverse variances of the measured variances.
        let (mut s, mut sg, mut sgg, mut sv, mut sgv) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((part, variation), expected) in read.iter().zip(&expected) {
            let weight = variation.degrees_of_freedom / (expected * expected);
            s += weight;
            sg += weight * part;
            sgg += weight * part * part;
            sv += weight * variation.variance;
            sgv += weight * part * variation.variance;
        }
        let determinant = s * sgg - sg * sg;
        let slope = if determinant > 1e-12 * s * sgg { (s * sgv - sg * sv) / determinant } else { 0.0 };
        let mut size = slope.max(0.0);
        let mut level = (sv - size * sg) / s;
        if level < level_min {
            level = level_min;
            size = if sgg > 0.0 { ((sgv - level * sg) / sgg).max(0.0) } else { 0.0 };
        }
        for ((part, _), expected) in read.iter().zip(&mut expected) {
            *expected = level + size * part;
        }
    }
    read.iter()
        .zip(&expected)
        .map(|((_, variation), expected)| {
            -0.5 * variation.degrees_of_freedom * (expected.ln() + variation.variance / expected)
        })
        .sum()
}

/// Log-likelihood ratio of a free variance to one of known level; 0 if the variance is smaller.
fn log_likelihood_excess(read: Variation, level: f64) -> f64 {
    let ratio = read.variance / level;
    if ratio > 1.0 { 0.5 * read.degrees_of_freedom * (ratio - 1.0 - ratio.ln()) } else { 0.0 }
}

/// Decision after a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Move {
    /// Move the valve to this opening, relative to the nominal area. The opening of the last reading means that it is repeated.
    To(f64),
    /// The line is done.
    Done(LineEnd),
}

/// Reason for the end of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineEnd {
    /// The surge flow is known with the required accuracy.
    AccuracyReached,
    /// Closing further would violate the required distance or the safe distance.
    DistanceReached,
    /// The maximum number of steps was reached.
    MaxSteps,
}

/// Step of the opening while surge is far by the nominal map, ratio.
const FAR_STEP_RATIO: f64 = 0.08;
/// Surge margin of the nominal map beyond which surge is far, ratio: the nominal surge line is uncertain.
const FAR_MARGIN_RATIO: f64 = 0.35;
/// Step that is allowed whatever the highest possible surge flow, ratio. If surge were that near, the variation would already be
/// larger at this opening, and only further readings can decide.
const SMALL_STEP_RATIO: f64 = 0.007;
/// Maximum extrapolation of the law, in multiples of the smallest margin: the start of the growth differs between rigs.
const MAX_EXTRAPOLATION: f64 = 1.4;
/// Minimum distance to the highest possible surge flow, ratio.
const MIN_DISTANCE_RATIO: f64 = 0.005;
/// Minimum useful step, ratio.
const MIN_STEP_RATIO: f64 = 0.004;
const MAX_READINGS_AT_OPENING: usize = 3;

/// Expected number of readings of a line on a machine like the nominal one, from a surge margin on.
pub fn expected_readings(margin_ratio: f64, seek: &SurgeSearchSettings) -> usize {
    let (mut flow, mut readings) = (1.0 + margin_ratio, 1);
    while flow > 1.0 + 1.3 * seek.closest_margin_ratio && readings < seek.most_steps {
        let far = flow - 1.0 > FAR_MARGIN_RATIO;
        flow *= 1.0 - if far { FAR_STEP_RATIO.max(seek.step_ratio) } else { seek.step_ratio };
        readings += 1;
    }
    // A few more near surge, where the steps are smaller.
    (readings + 3).min(seek.most_steps)
}

/// Chooses the next move; `readings` has at least one reading. `nominal_margin_ratio`: surge margin of the nominal machine
/// at the last opening; `None` if unknown.
pub fn choose_next_move(
    readings: &[SurgeReading],
    seek: &SurgeSearchSettings,
    nominal_margin_ratio: Option<f64>,
) -> Move {
    let Some(last) = readings.last() else { return Move::Done(LineEnd::MaxSteps) };
    if readings.len() >= seek.most_steps {
        return Move::Done(LineEnd::MaxSteps);
    }
    let opening = last.valve_opening_ratio;
    let estimate = SurgeEstimate::of(readings);
    let Some(estimate) = estimate.filter(|estimate| estimate.is_usable) else {
        let far = nominal_margin_ratio.is_some_and(|margin| margin > FAR_MARGIN_RATIO);
        let step = match estimate {
            // The variation grows, but at too few openings to estimate how fast.
            Some(estimate) if estimate.has_growth => 0.5 * seek.step_ratio,
            _ if far => FAR_STEP_RATIO.max(seek.step_ratio),
            _ => seek.step_ratio,
        };
        return Move::To(opening * (1.0 - step));
    };
    let margin_ratio = estimate.closest_flow_kg_s / estimate.flow_corrected_kg_s - 1.0;
    let near = margin_ratio <= MAX_EXTRAPOLATION * seek.closest_margin_ratio;
    if near && estimate.standard_error_ratio() <= seek.wanted_standard_error_ratio {
        return Move::Done(LineEnd::AccuracyReached);
    }
    // Near surge, pressures hardly change with flow: the flow is proportional to the opening.
    let flow_kg_s = estimate.closest_flow_kg_s;
    let possible_kg_s = estimate.flow_corrected_kg_s + 2.0 * estimate.standard_error_kg_s;
    let safe_kg_s = possible_kg_s.max(estimate.highest_flow_kg_s) * (1.0 + MIN_DISTANCE_RATIO);
    let lowest_kg_s = (flow_kg_s * (1.0 - seek.step_ratio))
        .max(safe_kg_s.min(flow_kg_s * (1.0 - SMALL_STEP_RATIO)))
        .max(estimate.flow_corrected_kg_s * (1.0 + seek.closest_margin_ratio));
    let step = 1.0 - lowest_kg_s / flow_kg_s;
    if step >= MIN_STEP_RATIO {
        return Move::To(opening * (1.0 - step));
    }
    let count = readings.iter().rev().take_while(|reading| reading.valve_opening_ratio == opening).count();
    if count < MAX_READINGS_AT_OPENING { Move::To(opening) } else { Move::Done(LineEnd::DistanceReached) }
}

/// Time over which the variation is computed, s. Bound: several cycles of the slowest surge.
const WINDOW_S: f64 = 1.0;
/// Fewest samples in this time. Source: SAE J1826 (2022), at least 100 Hz.
const MIN_FAST_SAMPLES: usize = 100;

/// The fast samples of the last second, by channel: times, s, and values.
#[derive(Debug, Clone, Default)]
pub(crate) struct FastStatistics {
    recent: BTreeMap<Channel, VecDeque<(f64, f64)>>,
}

impl FastStatistics {
    /// Adds a column with the variation of each fast channel over the second before each sample; NaN with too few fast samples.
    pub(crate) fn add_columns(&mut self, batch: &mut SampleBatch) {
        for FastSamples { channel, first_s, interval_s, values } in &batch.fast {
            let recent = self.recent.entry(*channel).or_default();
            let times_s = (0..values.len()).map(|index| first_s + index as f64 * interval_s);
            recent.extend(times_s.zip(values.iter().copied()).filter(|(_, value)| value.is_finite()));
        }
        for (channel, recent) in &mut self.recent {
            let Some(variation) = channel.variation() else { continue };
            let mut of_second = |t_s: f64| {
                let begin = recent.partition_point(|(sample_s, _)| *sample_s <= t_s - WINDOW_S);
                recent.drain(..begin);
                let count = recent.partition_point(|(sample_s, _)| *sample_s <= t_s);
                let values = || recent.iter().take(count).map(|(_, value)| *value);
                let mean = values().sum::<f64>() / count as f64;
                let square = values().map(|value| (value - mean).powi(2)).sum::<f64>() / count as f64;
                if count < MIN_FAST_SAMPLES { f64::NAN } else { square.sqrt() / mean }
            };
            let values = batch.t_s.iter().map(|t_s| of_second(*t_s)).collect();
            batch.columns.push(ChannelColumn { channel: variation, values });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn a_drift_of_the_mean_does_not_change_the_fast_variance() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        let normal = Normal::new(0.0, 0.5).unwrap();
        let t_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.1).collect();
        let values: Vec<f64> = t_s.iter().map(|t| 100.0 + 0.05 * t + normal.sample(&mut random)).collect();
        let found = Variation::of(&t_s, &values).unwrap();
        // 3840 degrees of freedom determine a variance to 2.3 %.
        assert!((found.variance / 0.25 - 1.0).abs() < 0.08, "{found:?}");
        assert!((3500.0..=3840.0).contains(&found.degrees_of_freedom), "{found:?}");
        assert_eq!(Variation::of(&t_s[..9], &values[..9]), None);
    }

    #[test]
    fn correlated_samples_have_fewer_degrees_of_freedom() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let t_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.1).collect();
        let mut now = 0.0;
        let values: Vec<f64> = t_s
            .iter()
            .map(|_| {
                now = -0.6 * now + 0.8 * normal.sample(&mut random);
                now
            })
            .collect();
        let found = Variation::of(&t_s, &values).unwrap();
        // Bartlett's formula: 1 + 2 sum 0.36^k = 2.12.
        assert!((found.degrees_of_freedom / (3840.0 / 2.12) - 1.0).abs() < 0.15, "{found:?}");
    }

    /// A sine of 2 % at 40 Hz about 200 kPa has a coefficient of variation of 2 %/sqrt(2); 50 Hz are too few.
    #[test]
    fn the_variation_is_that_of_a_sine() {
        for (rate_hz, expected) in [(1000.0, 0.02 / 2.0_f64.sqrt()), (50.0, f64::NAN)] {
            let mut statistics = FastStatistics::default();
            let mut last = f64::NAN;
            for second in 0..3 {
                let first_s = f64::from(second);
                let at = |i: usize| first_s + i as f64 / rate_hz;
                let swing = |t_s: f64| 0.02 * (std::f64::consts::TAU * 40.0 * t_s).sin();
                let values = (0..rate_hz as usize).map(|i| 200e3 * (1.0 + swing(at(i)))).collect();
                let fast = FastSamples { channel: Channel::P2, first_s, interval_s: 1.0 / rate_hz, values };
                let t_s = (1..=10).map(|i| first_s + 0.1 * f64::from(i)).collect();
                let mut batch = SampleBatch { t_s, fast: vec![fast], ..SampleBatch::default() };
                statistics.add_columns(&mut batch);
                last = batch.last(Channel::P2Variation).unwrap();
            }
            assert!(
                last.is_nan() == expected.is_nan() && (expected.is_nan() || (last - expected).abs() < 1e-4),
                "{rate_hz} Hz: {last}"
            );
        }
    }
}
