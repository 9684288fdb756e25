//! The surge flow, as far as the looks so far tell.

use crate::growth::{GrowthLaw, log_likelihood, log_likelihood_without};
use crate::look::{LOOKED_AT, Look};
use crate::smooth::Smoothed;
use crate::variation::Variation;

/// Exponents of the growth, with their weights before anything was read: theory says 1, rigs differ.
const EXPONENTS: [(f64, f64); 3] = [(0.7, 0.25), (1.0, 0.5), (1.4, 0.25)];
/// Margins at which the growth may begin, equally likely.
const ONSETS: [f64; 8] = [10.0, 0.3, 0.2, 0.15, 0.12, 0.1, 0.08, 0.06];
/// Places of the surge flow below the smallest one seen: smallest and largest distance, ratio, and how many.
const DISTANCES: (f64, f64, usize) = (5e-4, 0.4, 90);
/// How much likelier the readings must be with growth than without, natural logarithm, before it counts as seen: by chance
/// that happens once in some thousand looks (chi-squared of five, twice this).
const SEEN: f64 = 10.0;

/// What is known of the surge flow of a line, at the speed of its last look.
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
    /// Whether the variation grows at all; the other values have little meaning where it does not.
    pub seen: bool,
}

impl SurgeEstimate {
    /// The estimate from looks at ever smaller openings; `None` below four of them.
    pub fn of(looks: &[Look]) -> Option<Self> {
        if looks.len() < 4 {
            return None;
        }
        let Smoothed { flows_kg_s, flow_error_ratio } = Smoothed::of(looks)?;
        let closest_flow_kg_s = flows_kg_s.iter().copied().fold(f64::INFINITY, f64::min);
        let channels: Vec<Vec<(f64, Variation)>> = (0..LOOKED_AT.len())
            .map(|channel| {
                let read = looks.iter().zip(&flows_kg_s);
                read.filter_map(|(look, flow)| Some((*flow, look.variations[channel]?))).collect()
            })
            .filter(|read: &Vec<_>| read.len() >= 4)
            .collect();
        let without: f64 = channels.iter().map(|read| log_likelihood_without(read)).sum();
        let places = places(closest_flow_kg_s);
        let mut likeliest = f64::NEG_INFINITY;
        let mut logs: Vec<(usize, f64)> = Vec::new();
        for (place, (surge_kg_s, width)) in places.iter().enumerate() {
            let margins: Vec<Vec<(f64, Variation)>> = channels
                .iter()
                .map(|read| read.iter().map(|(flow, v)| (flow / surge_kg_s - 1.0, *v)).collect())
                .collect();
            for (exponent, weight) in EXPONENTS {
                for onset_ratio in ONSETS {
                    let law = GrowthLaw { exponent, onset_ratio };
                    let log: f64 = margins.iter().map(|read| log_likelihood(read, law)).sum();
                    likeliest = likeliest.max(log);
                    logs.push((place, log + (weight * width).ln()));
                }
            }
        }
        let best = logs.iter().map(|(_, log)| *log).fold(f64::NEG_INFINITY, f64::max);
        let mut weights = vec![0.0; places.len()];
        for (place, log) in logs {
            weights[place] += (log - best).exp();
        }
        let all: f64 = weights.iter().sum();
        let mean = places.iter().zip(&weights).map(|((flow, _), w)| flow * w).sum::<f64>() / all;
        let variance =
            places.iter().zip(&weights).map(|((flow, _), w)| (flow - mean).powi(2) * w).sum::<f64>() / all;
        // Places come from the nearest to the farthest: from the highest flow down.
        let mut above = 0.0;
        let highest = places.iter().zip(&weights).find(|(_, weight)| {
            above += **weight;
            above >= 0.02 * all
        });
        Some(SurgeEstimate {
            flow_corrected_kg_s: mean,
            standard_error_kg_s: variance.sqrt().hypot(flow_error_ratio * mean),
            highest_flow_kg_s: highest.map_or(closest_flow_kg_s, |((flow, _), _)| *flow),
            closest_flow_kg_s,
            seen: likeliest - without > SEEN,
        })
    }

    /// Standard error over the flow itself, ratio.
    pub fn standard_error_ratio(&self) -> f64 {
        self.standard_error_kg_s / self.flow_corrected_kg_s
    }
}

/// Surge flows to be weighed, from the highest down, kg/s, with the share of the logarithm of flow that each stands for.
fn places(closest_flow_kg_s: f64) -> Vec<(f64, f64)> {
    let (least, most, count) = DISTANCES;
    let step = (most / least).ln() / (count - 1) as f64;
    (0..count)
        .map(|i| {
            let distance = least * (step * i as f64).exp();
            (closest_flow_kg_s * (1.0 - distance), distance * step / (1.0 - distance))
        })
        .collect()
}
