//! Machines that deviate from the others of their production, and probable causes.

use mapper_numerics::statistics::{mean, median, robust_sigma};
use serde::Serialize;

/// Robust standard deviations from which a machine is an outlier (Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993).
const OUTLIER_SIGMAS: f64 = 3.5;
/// Minimum number of machines for the search for outliers; fewer do not show the usual scatter.
pub const MIN_MACHINES_FOR_OUTLIERS: usize = 8;

/// Deviation of each machine from the average machine at one point of the map; `None` if it was not measured there.
pub(crate) struct Deviations {
    /// Target speed, rpm.
    pub(crate) speed_rpm: f64,
    /// Efficiency of the average machine, fraction.
    pub(crate) eta_mean: f64,
    /// Efficiency minus the mean, fraction.
    pub(crate) eta: Vec<Option<f64>>,
    /// Logarithm of h minus that of the mean.
    pub(crate) ln_h: Vec<Option<f64>>,
}

/// A machine that deviates from the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outlier {
    /// The machine.
    pub machine: String,
    /// The pattern of its largest deviation.
    pub sign: DeviationPattern,
    /// Size of that deviation from the median machine, robust standard deviations.
    pub sigmas: f64,
    /// Efficiency minus that of the average machine, mean over the points, fraction.
    pub eta: f64,
    /// Relative deviation of efficiency that is the same at all speeds, ratio.
    pub eta_ratio: f64,
    /// Relative deviation of efficiency in proportion to 1/speed^2, at the lowest speed, ratio.
    pub eta_ratio_at_lowest_speed: f64,
    /// Relative deviation of h from that of the average machine, mean over the points, ratio.
    pub h_ratio: f64,
}

/// Patterns of deviation, each with its own probable causes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviationPattern {
    /// The same relative deviation of efficiency at all speeds: losses in proportion to the work.
    EfficiencyEverywhere,
    /// A relative deviation of efficiency in proportion to 1/speed^2, i.e. to one over the temperature rise: a fixed temperature error.
    EfficiencyAtLowSpeed,
    /// The same relative deviation of h everywhere.
    HeatTransfer,
}

impl DeviationPattern {
    const ALL: [DeviationPattern; 3] = [
        DeviationPattern::EfficiencyEverywhere,
        DeviationPattern::EfficiencyAtLowSpeed,
        DeviationPattern::HeatTransfer,
    ];

    /// Probable causes, in words.
    pub fn causes(self) -> &'static str {
        match self {
            DeviationPattern::EfficiencyEverywhere => "the wheel, its clearance, or the volute",
            DeviationPattern::EfficiencyAtLowSpeed => {
                "heat transfer other than declared (alpha_A, the housing, oil), or a replaced T1 or T2 sensor"
            }
            DeviationPattern::HeatTransfer => "the housing's wall or area, or the flow meter",
        }
    }
}

/// Deviation of one machine, fitted over the map.
#[derive(Debug, Clone, Copy)]
struct DeviationParameters {
    eta: f64,
    everywhere: f64,
    at_lowest: f64,
    ln_h: f64,
}

impl DeviationParameters {
    fn in_pattern(self, pattern: DeviationPattern) -> f64 {
        match pattern {
            DeviationPattern::EfficiencyEverywhere => self.everywhere,
            DeviationPattern::EfficiencyAtLowSpeed => self.at_lowest,
            DeviationPattern::HeatTransfer => self.ln_h,
        }
    }
}

/// Machines that deviate by more than [`OUTLIER_SIGMAS`] in any pattern, largest deviation first; `None` if too few were measured.
pub(crate) fn find_outliers(machines: &[String], places: &[Deviations]) -> Option<Vec<Outlier>> {
    let lowest_rpm = places.iter().map(|place| place.speed_rpm).fold(f64::INFINITY, f64::min);
    let deviations: Vec<Option<DeviationParameters>> =
        (0..machines.len()).map(|machine| fit_deviation(machine, places, lowest_rpm)).collect();
    let known: Vec<(usize, DeviationParameters)> = deviations
        .iter()
        .enumerate()
        .filter_map(|(machine, deviation)| Some((machine, (*deviation)?)))
        .collect();
    if known.len() < MIN_MACHINES_FOR_OUTLIERS {
        return None;
    }
    let mut scatter = Vec::new();
    for pattern in DeviationPattern::ALL {
        let values: Vec<f64> = known.iter().map(|(_, deviation)| deviation.in_pattern(pattern)).collect();
        let median = median(&values)?;
        scatter.push((pattern, median, robust_sigma(values.iter().map(|value| value - median))?));
    }
    let mut outliers: Vec<Outlier> = known
        .into_iter()
        .filter_map(|(machine, deviation)| {
            let sigmas = |(pattern, median, sigma): &(DeviationPattern, f64, f64)| {
                let distance = deviation.in_pattern(*pattern) - median;
                // Identical machines have no scatter.
                (*pattern, if *sigma > 0.0 { distance / sigma } else { 0.0 })
            };
            let (pattern, sigmas) =
                scatter.iter().map(sigmas).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
            (sigmas.abs() > OUTLIER_SIGMAS).then(|| Outlier {
                machine: machines[machine].clone(),
                sign: pattern,
                sigmas,
                eta: deviation.eta,
                eta_ratio: deviation.everywhere,
                eta_ratio_at_lowest_speed: deviation.at_lowest,
                h_ratio: deviation.ln_h.exp_m1(),
            })
        })
        .collect();
    outliers.sort_by(|a, b| b.sigmas.abs().total_cmp(&a.sigmas.abs()));
    Some(outliers)
}

/// Fits the relative deviations of efficiency by least squares to `a + b (lowest speed / speed)^2`.
fn fit_deviation(machine: usize, places: &[Deviations], lowest_rpm: f64) -> Option<DeviationParameters> {
    let eta: Vec<(f64, f64, f64)> = places
        .iter()
        .filter_map(|place| {
            let eta = (*place.eta.get(machine)?)?;
            Some(((lowest_rpm / place.speed_rpm).powi(2), eta / place.eta_mean, eta))
        })
        .filter(|(_, ratio, _)| ratio.is_finite())
        .collect();
    let ln_h = mean(places.iter().filter_map(|place| *place.ln_h.get(machine)?));
    let mean_x = mean(eta.iter().map(|(x, ..)| *x))?;
    let mean_y = mean(eta.iter().map(|(_, y, _)| *y))?;
    let variance: f64 = eta.iter().map(|(x, ..)| (x - mean_x).powi(2)).sum();
    let covariance: f64 = eta.iter().map(|(x, y, _)| (x - mean_x) * (y - mean_y)).sum();
    // One speed alone does not show a dependence on speed.
    let at_lowest = if variance > 1e-6 { covariance / variance } else { 0.0 };
    Some(DeviationParameters {
        eta: mean(eta.iter().map(|(.., eta)| *eta))?,
        everywhere: mean_y - at_lowest * mean_x,
        at_lowest,
        ln_h: ln_h.unwrap_or(0.0),
    })
}
