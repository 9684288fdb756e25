//! Numbers that turn scores into probabilities: found on simulated campaigns, kept in a data file with the seed and
//! the command that made it.

use serde::{Deserialize, Serialize};

/// What was calibrated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// The command that made it, with its seed.
    pub made_by: String,
    /// A cause is named where its score exceeds that of nothing by more than this.
    pub threshold: f64,
    /// Divides the differences of scores.
    pub temperature: f64,
    /// Prior of nothing.
    pub prior_none: f64,
    /// Prior of all singles together.
    pub prior_single: f64,
    /// Prior of all pairs together.
    pub prior_pair: f64,
    /// Prior of all triples together; each further effect is less likely by this factor again.
    pub prior_triple: f64,
    /// Widens the parameters' standard errors.
    pub interval_factor: f64,
    /// Logistic of an outside cause: offset, and slopes of the [`counted`] misfit, scatter and gain of one more effect.
    pub outside: [f64; 4],
}

/// The data file.
const TEXT: &str = include_str!("../calibration.json");

impl Calibration {
    /// The calibration that ships.
    ///
    /// # Errors
    /// The parser's, where the data file was spoilt.
    pub fn shipped() -> Result<Calibration, serde_json::Error> {
        serde_json::from_str(TEXT)
    }

    /// Probability of an outside cause by what the best fit leaves.
    pub fn outside(&self, features: [f64; 3]) -> f64 {
        let [offset, slopes @ ..] = self.outside;
        let x = offset + slopes.iter().zip(counted(features)).map(|(slope, x)| slope * x).sum::<f64>();
        1.0 / (1.0 + (-x).exp())
    }
}

/// Largest square of a misfit that counts, halved: gross misfits are all alike.
const MAX: f64 = 500.0;

/// What the features of an outside cause count as in its logistic. The smooth misfit by half its square, which is the logarithm of
/// how unlikely noise makes it. The scatter from step to step and the gain of one more effect by their order of magnitude: they
/// grow with the strength of a cause, also of one that is found, which the model's lines follow to a few per cent only.
pub fn counted([smooth_sigma, scatter_sigma, one_more]: [f64; 3]) -> [f64; 3] {
    let unlikely = 0.5 * smooth_sigma.max(0.0).powi(2);
    [unlikely.min(MAX), scatter_sigma.max(0.0).asinh(), one_more.max(0.0).asinh()]
}
