//! Estimates the surge flow from the readings so far.

use crate::surge::growth_law::{GrowthLaw, Observation, log_likelihood, log_likelihood_excess};
use crate::surge::smoothed_flow::SmoothedFlow;
use crate::surge::surge_reading::{PRECURSOR_CHANNELS, SurgeReading};
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
