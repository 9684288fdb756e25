//! A number of a point as a function of the shared parameters, the number with its error, and what the errors of all numbers share.

use crate::joint::fit::solve::Covariance;
use mapper_core::EstimateUncertainty;
use mapper_inference::mixture::MIN_WEIGHT;
use nalgebra::{DMatrix, DVector};

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

/// Change of each quantity per standard deviation of each common error: the common part of their errors, as a few independent ones.
///
/// `covariance` is that of the quantities, `own_variances` the part of its diagonal that no other quantity shares. The common remainder is
/// described by its leading eigenvectors (factor analysis by principal factors), scaled to the standard errors in `errors`.
pub(crate) fn common_part(covariance: &DMatrix<f64>, own_variances: &[f64], errors: &[f64]) -> Vec<Vec<f64>> {
    let count = errors.len();
    let none = vec![Vec::new(); count];
    let mut rest = covariance.clone();
    for (i, own) in own_variances.iter().enumerate() {
        rest[(i, i)] = (rest[(i, i)] - own.max(0.0)).max(0.0);
    }
    if count < 2 || !rest.iter().all(|x| x.is_finite()) {
        return none;
    }
    let trace = rest.trace();
    let eigen = rest.symmetric_eigen();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let leading = order.iter().filter(|k| eigen.eigenvalues[**k] > MIN_WEIGHT * trace);
    let mut changes = none;
    for k in leading {
        let vector = eigen.eigenvectors.column(*k);
        // The sign of an eigenvector is arbitrary: make its sum positive.
        let size = eigen.eigenvalues[*k].sqrt() * if vector.sum() < 0.0 { -1.0 } else { 1.0 };
        for (i, changes) in changes.iter_mut().enumerate() {
            changes.push(size * vector[i]);
        }
    }
    for (i, (changes, error)) in changes.iter_mut().zip(errors).enumerate() {
        let all = covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        let shared = changes.iter().map(|change| change * change).sum::<f64>().sqrt();
        // The common part must not exceed the whole.
        let scale = error / all.max(shared);
        changes.iter_mut().for_each(|change| *change *= scale);
    }
    changes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Recovers two common errors and one individual error per quantity from their combined covariance.
    #[test]
    fn what_was_put_in_comes_out() {
        let [first, second] = [[1.0, 2.0, 3.0, 2.0, 1.0], [0.5, -0.5, 0.0, 0.5, -0.5]];
        let own: [f64; 5] = [0.1, 0.4, 0.2, 0.3, 0.1];
        let covariance = DMatrix::from_fn(5, 5, |i, j| {
            first[i] * first[j] + second[i] * second[j] + if i == j { own[i] } else { 0.0 }
        });
        let errors: Vec<f64> = (0..5).map(|i| covariance[(i, i)].sqrt()).collect();
        let found = common_part(&covariance, &own, &errors);
        for i in 0..5 {
            for j in 0..5 {
                let shared: f64 = found[i].iter().zip(&found[j]).map(|(a, b)| a * b).sum();
                let expected = covariance[(i, j)] - if i == j { own[i] } else { 0.0 };
                assert!((shared - expected).abs() < 1e-9, "{i} {j}: {shared} and {expected}");
            }
        }
    }
}
