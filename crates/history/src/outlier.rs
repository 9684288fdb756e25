//! Machines that are not like the others of their production, and what that may come from.

use mapper_numerics::statistics::{mean, median, robust_sigma};
use serde::Serialize;

/// Robust standard deviations from which a machine is an outlier (Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993).
const OUTLYING_SIGMAS: f64 = 3.5;
/// Machines from which on the middle half says what is usual.
pub const MACHINES_FOR_OUTLIERS: usize = 8;

/// How far each machine lies off the average one at one place; `None` if it was not measured.
pub(crate) struct Deviations {
    /// Speed aimed at, rpm.
    pub(crate) speed_rpm: f64,
    /// Efficiency of the average machine, fraction.
    pub(crate) eta_mean: f64,
    /// Efficiency less the mean, fraction.
    pub(crate) eta: Vec<Option<f64>>,
    /// Logarithm of h less that of the mean.
    pub(crate) ln_h: Vec<Option<f64>>,
}

/// A machine that is not like the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outlier {
    /// The machine.
    pub machine: String,
    /// What it shows most clearly.
    pub sign: Sign,
    /// How far it lies off the middle of all machines in that, robust standard deviations.
    pub sigmas: f64,
    /// Efficiency less that of the average machine, mean over the points, fraction.
    pub eta: f64,
    /// Part of its efficiency that it is off by at all speeds alike, ratio.
    pub eta_ratio: f64,
    /// The part that goes with 1/speed^2, at the lowest speed, ratio.
    pub eta_ratio_at_lowest_speed: f64,
    /// h less that of the average machine, mean over the points, ratio.
    pub h_ratio: f64,
}

/// The forms in which a machine differs, each with causes of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sign {
    /// The same part of the efficiency at all speeds: losses follow the work.
    EfficiencyEverywhere,
    /// A part of the efficiency that goes with 1/speed^2, as one over the temperature rise: a fixed difference of temperature.
    EfficiencyAtLowSpeed,
    /// h by the same ratio everywhere.
    HeatTransfer,
}

impl Sign {
    const ALL: [Sign; 3] = [Sign::EfficiencyEverywhere, Sign::EfficiencyAtLowSpeed, Sign::HeatTransfer];

    /// Probable causes, in words.
    pub fn causes(self) -> &'static str {
        match self {
            Sign::EfficiencyEverywhere => "the wheel, its clearance, or the volute",
            Sign::EfficiencyAtLowSpeed => {
                "heat that is not as declared (alpha_A, the housing, oil), or a T1 or T2 sensor of its own"
            }
            Sign::HeatTransfer => "the housing's wall or area, or the reading of the flow",
        }
    }
}

/// The three numbers of one machine.
#[derive(Debug, Clone, Copy)]
struct Signs {
    eta: f64,
    everywhere: f64,
    at_lowest: f64,
    ln_h: f64,
}

impl Signs {
    fn of(self, sign: Sign) -> f64 {
        match sign {
            Sign::EfficiencyEverywhere => self.everywhere,
            Sign::EfficiencyAtLowSpeed => self.at_lowest,
            Sign::HeatTransfer => self.ln_h,
        }
    }
}

/// Machines beyond [`OUTLYING_SIGMAS`] in any sign, farthest first; `None` if too few were measured.
pub(crate) fn outliers(machines: &[String], places: &[Deviations]) -> Option<Vec<Outlier>> {
    let lowest = places.iter().map(|place| place.speed_rpm).fold(f64::INFINITY, f64::min);
    let signs: Vec<Option<Signs>> =
        (0..machines.len()).map(|machine| signs(machine, places, lowest)).collect();
    let known: Vec<(usize, Signs)> =
        signs.iter().enumerate().filter_map(|(machine, signs)| Some((machine, (*signs)?))).collect();
    if known.len() < MACHINES_FOR_OUTLIERS {
        return None;
    }
    let mut usual = Vec::new();
    for sign in Sign::ALL {
        let values: Vec<f64> = known.iter().map(|(_, signs)| signs.of(sign)).collect();
        let middle = median(&values)?;
        usual.push((sign, middle, robust_sigma(values.iter().map(|value| value - middle))?));
    }
    let mut found: Vec<Outlier> = known
        .into_iter()
        .filter_map(|(machine, signs)| {
            let sigmas = |(sign, middle, sigma): &(Sign, f64, f64)| {
                let off = signs.of(*sign) - middle;
                // Machines that are all the same leave no scatter to count by.
                (*sign, if *sigma > 0.0 { off / sigma } else { 0.0 })
            };
            let (sign, sigmas) = usual.iter().map(sigmas).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
            (sigmas.abs() > OUTLYING_SIGMAS).then(|| Outlier {
                machine: machines[machine].clone(),
                sign,
                sigmas,
                eta: signs.eta,
                eta_ratio: signs.everywhere,
                eta_ratio_at_lowest_speed: signs.at_lowest,
                h_ratio: signs.ln_h.exp_m1(),
            })
        })
        .collect();
    found.sort_by(|a, b| b.sigmas.abs().total_cmp(&a.sigmas.abs()));
    Some(found)
}

/// Least squares of the relative deviations of efficiency on 1 and (lowest speed / speed)^2.
fn signs(machine: usize, places: &[Deviations], lowest_rpm: f64) -> Option<Signs> {
    let eta: Vec<(f64, f64, f64)> = places
        .iter()
        .filter_map(|place| {
            let eta = (*place.eta.get(machine)?)?;
            Some(((lowest_rpm / place.speed_rpm).powi(2), eta / place.eta_mean, eta))
        })
        .filter(|(_, ratio, _)| ratio.is_finite())
        .collect();
    let ln_h = mean(places.iter().filter_map(|place| *place.ln_h.get(machine)?));
    let middle_x = mean(eta.iter().map(|(x, ..)| *x))?;
    let middle_y = mean(eta.iter().map(|(_, y, _)| *y))?;
    let spread: f64 = eta.iter().map(|(x, ..)| (x - middle_x).powi(2)).sum();
    let across: f64 = eta.iter().map(|(x, y, _)| (x - middle_x) * (y - middle_y)).sum();
    // One speed alone does not show a dependence on speed.
    let at_lowest = if spread > 1e-6 { across / spread } else { 0.0 };
    Some(Signs {
        eta: mean(eta.iter().map(|(.., eta)| *eta))?,
        everywhere: middle_y - at_lowest * middle_x,
        at_lowest,
        ln_h: ln_h.unwrap_or(0.0),
    })
}
