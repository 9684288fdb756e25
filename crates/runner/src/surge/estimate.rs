//! The surge flow extrapolated from the growth of the variation, and the next move of a search.

use crate::surge::variation::{PRECURSOR_CHANNELS, SmoothedFlow, SurgeReading, Variation};
use mapper_core::SurgeSearchSettings;
use mapper_numerics::statistics::mean;

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

/// The variance of a channel far from surge.
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
    pub(crate) exponent: f64,
    /// Margin at which the growth begins.
    pub(crate) onset_ratio: f64,
}

impl GrowthLaw {
    /// The growing part at a margin, without its scale factor.
    pub(crate) fn growth_at(self, margin_ratio: f64) -> f64 {
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
pub(crate) fn log_likelihood(read: &[Observation]) -> f64 {
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
pub(crate) fn log_likelihood_excess(read: Variation, level: f64) -> f64 {
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
