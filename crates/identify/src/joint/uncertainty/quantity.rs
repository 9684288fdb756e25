//! A number of a point as a function of the shared parameters, and the number with its error.

use crate::joint::fit::solve::Covariance;
use mapper_core::EstimateUncertainty;
use nalgebra::DVector;

/// A number as a function of the shared parameters.
pub(crate) struct Quantity {
    pub(crate) value: f64,
    /// Sensitivity to the shared parameters.
    pub(crate) answer: DVector<f64>,
    /// Variance with all shared parameters known.
    pub(crate) own_variance: f64,
}

impl Quantity {
    /// Its variance.
    pub(crate) fn variance(&self, covariance: &Covariance) -> f64 {
        self.own_variance + self.answer.dot(&(&covariance.shared * &self.answer))
    }
}

/// A number with its error by origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Number {
    pub(crate) value: f64,
    pub(crate) uncertainty: EstimateUncertainty,
    /// Its 95 % interval: symmetric about the value for a normal distribution, otherwise the shortest one.
    pub(crate) interval: (f64, f64),
    /// Standard error without the interval's excess over the mixture, and that excess, which all numbers share.
    pub(crate) error: f64,
    pub(crate) added: f64,
}
