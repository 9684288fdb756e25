//! Constants that convert scores into probabilities, calibrated on simulated campaigns. The data file records the command that produced it.

use mapper_inference::posterior::{Rules, probability};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Calibration constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Command that produced the constants, with its seed.
    pub made_by: String,
    /// Minimum score above that of no cause for a cause to be named.
    pub threshold: f64,
    /// Divisor of score differences.
    pub temperature: f64,
    /// Prior of no cause.
    pub prior_none: f64,
    /// Prior of all singles together.
    pub prior_single: f64,
    /// Prior of all pairs together.
    pub prior_pair: f64,
    /// Prior of all triples together; each further effect multiplies the prior by this factor again.
    pub prior_triple: f64,
    /// Factor on the parameters' standard errors.
    pub interval_factor: f64,
    /// Share of recordings with causes of the effect library in which these are not among the candidates.
    pub unlisted: f64,
    /// Logistic model of an unmodelled cause: offset, and slopes of the features of a score.
    pub outside: [f64; 3],
    /// Where each number comes from, by its key; those of `outside` are `outside_0` to `outside_2`.
    pub origins: BTreeMap<String, Origin>,
}

/// Where a number of the calibration comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Fitted: the data determine it.
    Data,
    /// Fitted, but it ends at a bound that was set by hand.
    Bound,
    /// Fitted, but the data hardly narrow its prior.
    Prior,
    /// Not fitted.
    Copied,
}

const TEXT: &str = include_str!("../../../calibration.json");

impl Calibration {
    /// Returns the shipped calibration.
    ///
    /// # Errors
    /// A parser error if the data file is corrupt.
    pub fn shipped() -> Result<Calibration, serde_json::Error> {
        serde_json::from_str(TEXT)
    }

    /// Probability of an unmodelled cause, given smooth misfit and scatter of the best fit, in standard deviations.
    pub fn outside(&self, features: [f64; 2]) -> f64 {
        let [offset, slopes @ ..] = self.outside;
        let x = offset
            + slopes
                .iter()
                .zip(Calibration::logistic_features(features))
                .map(|(slope, x)| slope * x)
                .sum::<f64>();
        probability(x)
    }

    /// The rules by which the fits of a search become probabilities. Its sets are reduced to the members that the recording supports.
    pub fn rules(&self) -> Rules {
        let Calibration { threshold, temperature, unlisted, .. } = *self;
        Rules { threshold, temperature, unlisted, part_margin: 0.0 }
    }
}

/// Upper limit of half the squared misfit, above which all misfits count as equally large. Bound: its logistic model is certain
/// long before.
const MAX: f64 = 500.0;

impl Calibration {
    /// Transforms the features of an unmodelled cause for its logistic model. Smooth misfit enters as half its square, the negative
    /// log-probability under noise. Scatter enters by order of magnitude: it grows with any cause, which linearised models follow only to a few per
    /// cent.
    pub fn logistic_features([smooth_sigma, scatter_sigma]: [f64; 2]) -> [f64; 2] {
        let unlikely = 0.5 * smooth_sigma.max(0.0).powi(2);
        [unlikely.min(MAX), scatter_sigma.max(0.0).asinh()]
    }
}
