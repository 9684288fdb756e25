//! A mixture over which parameters differ from neutral, evaluated on one Gaussian.
//!
//! A fit with all parameters free gives one Gaussian likelihood of them. Each parameter is either exactly neutral (the spike) or has a
//! zero-mean normal prior, truncated to its range (the slab). The evidence of each of the `2^n` sets follows in closed form from the one
//! Gaussian (the Savage-Dickey density ratio: Dickey, Ann. Math. Stat. 42:204, 1971; spike and slab: Mitchell and Beauchamp, JASA 83:1023,
//! 1988). In the prior every *number* of parameters off neutral is equally probable, and so is every set of that number, which corrects for
//! multiple comparisons (Scott and Berger, Ann. Stat. 38:2587, 2010). A machine that differs in one respect from its declaration
//! is then more likely to differ in another.

use mapper_numerics::statistics::{BoundedNormal, normal_quantile};
use nalgebra::{DMatrix, DVector};

/// Number of draws of each set, and of a posterior. Bound: means and probabilities then agree with sums over a grid to some thousandths
/// (tested below).
pub const DRAWS: usize = 128;
/// Minimum probability of a set that gets draws. Bound: a fiftieth of the probability outside a 95 % interval.
pub const MIN_WEIGHT: f64 = 1e-3;

/// A parameter that may be neutral. All values are distances from neutral.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Standard deviation of the slab.
    pub slab_sigma: f64,
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// Apparent change that small errors of the model can cause, one standard deviation; it enters the evidence only.
    pub model_error: f64,
    /// Standard deviation of the normal prior in the fit that gave the Gaussian; infinite for none.
    pub fitted_under_sigma: f64,
}

/// Values of all parameters with their weight.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    /// Weight; all weights add up to 1.
    pub weight: f64,
    /// Distances from neutral, one for each parameter.
    pub values: DVector<f64>,
}

/// Posterior of the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixture {
    /// Draws of all sets.
    pub draws: Vec<Draw>,
    /// Draws of the set of all parameters: the posterior if none is neutral.
    pub all_free: Vec<Draw>,
    /// Probability of each parameter to differ from neutral.
    pub off_neutral: Vec<f64>,
}

impl Mixture {
    /// Evaluates all sets from a fit (distances from neutral) with all parameters free. `None` if it is not finite or positive definite.
    pub fn of(mean: &DVector<f64>, covariance: &DMatrix<f64>, parameters: &[Parameter]) -> Option<Self> {
        let count = parameters.len();
        if mean.len() != count || covariance.shape() != (count, count) {
            return None;
        }
        if !mean.iter().chain(covariance.iter()).all(|number| number.is_finite()) {
            return None;
        }
        let exact = Likelihood::of(mean, covariance, parameters)?;
        let widened = exact.with_model_errors(parameters)?;
        let sets: Vec<Vec<usize>> =
            (0..1usize << count).map(|set| (0..count).filter(|i| set >> i & 1 == 1).collect()).collect();
        let logs: Vec<f64> = sets
            .iter()
            .map(|free| {
                let evidence = widened.ln_evidence(free, parameters).unwrap_or(f64::NEG_INFINITY);
                evidence - ln_choose(count, free.len())
            })
            .collect();
        let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !best.is_finite() {
            return None;
        }
        let total: f64 = logs.iter().map(|log| (log - best).exp()).sum();
        let mut mixture = Mixture { draws: Vec::new(), all_free: Vec::new(), off_neutral: vec![0.0; count] };
        exact.draw(&(0..count).collect::<Vec<_>>(), parameters, 1.0, &mut mixture.all_free)?;
        for (free, log) in sets.iter().zip(&logs) {
            let weight = (log - best).exp() / total;
            free.iter().for_each(|i| mixture.off_neutral[*i] += weight);
            if weight > MIN_WEIGHT {
                exact.draw(free, parameters, weight, &mut mixture.draws)?;
            }
        }
        let drawn: f64 = mixture.draws.iter().map(|draw| draw.weight).sum();
        mixture.draws.iter_mut().for_each(|draw| draw.weight /= drawn);
        Some(mixture)
    }

    /// Mean of each parameter's distance from neutral.
    pub fn mean(&self) -> Option<DVector<f64>> {
        self.draws.iter().map(|draw| draw.weight * &draw.values).reduce(|sum, one| sum + one)
    }

    /// Covariance of the parameters.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let mean = self.mean()?;
        self.draws
            .iter()
            .map(|draw| {
                let deviation = &draw.values - &mean;
                draw.weight * &deviation * deviation.transpose()
            })
            .reduce(|sum, one| sum + one)
    }
}

/// ln of the number of sets of `some` out of `all`.
fn ln_choose(all: usize, some: usize) -> f64 {
    (0..some).map(|k| ((all - k) as f64 / (k + 1) as f64).ln()).sum()
}

/// A Gaussian likelihood in its natural form: precision, and precision times the mean. The precision may be singular.
struct Likelihood {
    precision: DMatrix<f64>,
    precision_mean: DVector<f64>,
}

impl Likelihood {
    fn of(mean: &DVector<f64>, covariance: &DMatrix<f64>, parameters: &[Parameter]) -> Option<Self> {
        let mut precision = covariance.clone().cholesky()?.inverse();
        let precision_mean = &precision * mean;
        for (i, parameter) in parameters.iter().enumerate() {
            precision[(i, i)] -= parameter.fitted_under_sigma.powi(-2);
        }
        Some(Likelihood { precision, precision_mean })
    }

    fn with_model_errors(&self, parameters: &[Parameter]) -> Option<Self> {
        let errors =
            DVector::from_iterator(parameters.len(), parameters.iter().map(|p| p.model_error.powi(2)));
        let count = parameters.len();
        let spread = DMatrix::identity(count, count) + &self.precision * DMatrix::from_diagonal(&errors);
        let inverse = spread.try_inverse()?;
        let precision = &inverse * &self.precision;
        Some(Likelihood {
            precision: 0.5 * (&precision + precision.transpose()),
            precision_mean: inverse * &self.precision_mean,
        })
    }

    /// Mean and covariance of the free parameters with the others neutral, under their normal priors without truncation.
    fn posterior(&self, free: &[usize], parameters: &[Parameter]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let precision = DMatrix::from_fn(free.len(), free.len(), |a, b| {
            let own = if a == b { parameters[free[a]].slab_sigma.powi(-2) } else { 0.0 };
            self.precision[(free[a], free[b])] + own
        });
        let covariance = precision.cholesky()?.inverse();
        let precision_mean = DVector::from_iterator(free.len(), free.iter().map(|i| self.precision_mean[*i]));
        Some((&covariance * precision_mean, covariance))
    }

    /// ln of the Bayes factor of a set against the empty set.
    fn ln_evidence(&self, free: &[usize], parameters: &[Parameter]) -> Option<f64> {
        if free.is_empty() {
            return Some(0.0);
        }
        let (mean, covariance) = self.posterior(free, parameters)?;
        let precision_mean = DVector::from_iterator(free.len(), free.iter().map(|i| self.precision_mean[*i]));
        let factors = covariance.clone().cholesky()?;
        let ln_volume: f64 = factors.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        let prior: f64 = free
            .iter()
            .map(|i| {
                let parameter = &parameters[*i];
                parameter.slab_sigma.ln() + bounded(0.0, parameter.slab_sigma, parameter).mass().ln()
            })
            .sum();
        let mass: f64 = draw_within_ranges(&mean, &covariance, free, parameters)?
            .iter()
            .map(|(mass, _)| mass)
            .sum::<f64>()
            / DRAWS as f64;
        Some(0.5 * precision_mean.dot(&mean) + ln_volume - prior + mass.max(f64::MIN_POSITIVE).ln())
    }

    fn draw(
        &self,
        free: &[usize],
        parameters: &[Parameter],
        weight: f64,
        draws: &mut Vec<Draw>,
    ) -> Option<()> {
        if free.is_empty() {
            draws.push(Draw { weight, values: DVector::zeros(parameters.len()) });
            return Some(());
        }
        let (mean, covariance) = self.posterior(free, parameters)?;
        let points = draw_within_ranges(&mean, &covariance, free, parameters)?;
        let total: f64 = points.iter().map(|(mass, _)| mass).sum();
        for (mass, point) in points {
            let mut values = DVector::zeros(parameters.len());
            free.iter().zip(point.iter()).for_each(|(i, value)| values[*i] = *value);
            // If no part of the Gaussian lies within the range, every draw lies on the bound, and all have equal weight.
            let share = if total > 0.0 { mass / total } else { 1.0 / DRAWS as f64 };
            draws.push(Draw { weight: weight * share, values });
        }
        Some(())
    }
}

fn bounded(mean: f64, sigma: f64, parameter: &Parameter) -> BoundedNormal {
    BoundedNormal { mean, sigma, low: parameter.low, high: parameter.high }
}

/// Points of a Gaussian within the ranges, each with its weight; the mean of the weights is the share that lies within. The parameters
/// are drawn one by one from its truncated normal, given those before (Geweke, Hajivassiliou and Keane: e.g. Train, Discrete
/// Choice Methods with Simulation, 2009, section 5.6), at the points of a Halton sequence.
fn draw_within_ranges(
    mean: &DVector<f64>,
    covariance: &DMatrix<f64>,
    free: &[usize],
    parameters: &[Parameter],
) -> Option<Vec<(f64, DVector<f64>)>> {
    let lower = covariance.clone().cholesky()?.l();
    let bases: Vec<usize> = primes().take(free.len()).collect();
    let point = |index: usize| {
        let (mut normal, mut mass) = (DVector::zeros(free.len()), 1.0);
        let mut values = DVector::zeros(free.len());
        for a in 0..free.len() {
            let conditional_mean = mean[a] + (0..a).map(|b| lower[(a, b)] * normal[b]).sum::<f64>();
            let distribution = bounded(conditional_mean, lower[(a, a)], &parameters[free[a]]);
            mass *= distribution.mass();
            values[a] = distribution.quantile(halton_point(index, bases[a]));
            normal[a] = (values[a] - conditional_mean) / lower[(a, a)];
        }
        (mass, values)
    };
    Some((0..DRAWS).map(point).collect())
}

/// Points of a standard normal distribution, evenly spread (a Halton sequence): a mean over them replaces one over many random draws.
pub fn normal_points(dimensions: usize) -> Vec<Vec<f64>> {
    let bases: Vec<usize> = primes().take(dimensions).collect();
    let coordinate = |index: usize, base: &usize| normal_quantile(halton_point(index, *base)).unwrap_or(0.0);
    let point = |index: usize| bases.iter().map(|base| coordinate(index, base)).collect();
    (0..DRAWS).map(point).collect()
}

/// Bases of the Halton sequence, one for each parameter.
fn primes() -> impl Iterator<Item = usize> {
    (2..).filter(|n| (2..*n).all(|divisor| n % divisor != 0))
}

/// The radical inverse of `index` + 1, between 0 and 1 (Halton, Numer. Math. 2:84, 1960).
fn halton_point(index: usize, base: usize) -> f64 {
    let (mut rest, mut digit, mut value) = (index + 1, 1.0 / base as f64, 0.0);
    while rest > 0 {
        value += digit * (rest % base) as f64;
        rest /= base;
        digit /= base as f64;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

    fn parameter(slab_sigma: f64, (low, high): (f64, f64), model_error: f64) -> Parameter {
        Parameter { slab_sigma, low, high, model_error, fitted_under_sigma: f64::INFINITY }
    }

    /// Every evidence and mean against sums over a fine grid of likelihood times prior.
    #[test]
    fn two_parameters_are_what_a_grid_says() {
        for (found, bounds) in
            [([0.06, -0.02], (0.0, 1.0)), ([-0.03, 0.05], (0.0, 1.0)), ([0.05, 0.09], ANYWHERE)]
        {
            let mean = DVector::from_row_slice(&found);
            let covariance = DMatrix::from_row_slice(2, 2, &[9e-4, 5e-4, 5e-4, 16e-4]);
            let parameters = [parameter(0.1, bounds, 0.0), parameter(0.2, ANYWHERE, 0.0)];
            let mixture = Mixture::of(&mean, &covariance, &parameters).unwrap();
            let inverse = covariance.try_inverse().unwrap();
            let likelihood = |a: f64, b: f64| {
                let off = DVector::from_row_slice(&[a, b]) - &mean;
                (-0.5 * off.dot(&(&inverse * &off))).exp()
            };
            let step = 2e-3;
            let density = |x: f64, sigma: f64, low: f64| {
                if x < low {
                    return 0.0;
                }
                let half = if low == 0.0 { 2.0 } else { 1.0 };
                half * (-0.5 * (x / sigma).powi(2)).exp() / (sigma * std::f64::consts::TAU.sqrt())
            };
            // Midpoints, so that the bound at 0 cuts no cell.
            let grid: Vec<f64> = (-300..300).map(|k| (f64::from(k) + 0.5) * step).collect();
            // Numbers of parameters off neutral are equally likely: none 1/3, one 1/3 in two sets, both 1/3.
            let mut sums = [likelihood(0.0, 0.0) / 3.0, 0.0, 0.0, 0.0];
            let mut means = [0.0; 2];
            for &x in &grid {
                let (a, b) = (density(x, 0.1, bounds.0), density(x, 0.2, ANYWHERE.0));
                let (first, second) =
                    (likelihood(x, 0.0) * a * step / 6.0, likelihood(0.0, x) * b * step / 6.0);
                sums[1] += first;
                sums[2] += second;
                means[0] += x * first;
                means[1] += x * second;
                for &y in grid.iter().filter(|_| a > 0.0) {
                    let both = likelihood(x, y) * a * density(y, 0.2, ANYWHERE.0) * step * step / 3.0;
                    sums[3] += both;
                    means[0] += x * both;
                    means[1] += y * both;
                }
            }
            let total: f64 = sums.iter().sum();
            let expected = [(sums[1] + sums[3]) / total, (sums[2] + sums[3]) / total];
            let drawn = mixture.mean().unwrap();
            for i in 0..2 {
                // 128 points of a Halton sequence in two dimensions leave some thousandths.
                assert!((mixture.off_neutral[i] - expected[i]).abs() < 5e-3, "{found:?} {i}: {mixture:?}");
                assert!((drawn[i] - means[i] / total).abs() < 1e-3, "{found:?} {i}: {drawn:?}");
            }
        }
    }

    /// The prior under which the Gaussian was found leaves no trace.
    #[test]
    fn the_prior_of_the_fit_is_taken_out() {
        let plain = [parameter(0.1, ANYWHERE, 0.01)];
        let fitted = [Parameter { fitted_under_sigma: 0.05, ..plain[0] }];
        let (mean, variance) = (0.04, 4e-4);
        let shrunk = 1.0 / (1.0 / variance + 1.0 / 0.0025);
        let of = |mean: f64, variance: f64, parameters: &[Parameter]| {
            let covariance = DMatrix::from_element(1, 1, variance);
            Mixture::of(&DVector::from_element(1, mean), &covariance, parameters).unwrap()
        };
        let (one, other) = (of(mean, variance, &plain), of(mean * shrunk / variance, shrunk, &fitted));
        assert!((one.off_neutral[0] - other.off_neutral[0]).abs() < 1e-12);
        assert!((one.mean().unwrap() - other.mean().unwrap()).norm() < 1e-12);
    }

    /// An estimate within the model's error proves nothing; one far beyond it is certain.
    #[test]
    fn the_error_of_the_model_counts_in_the_evidence() {
        let off = |found: f64, model_error: f64| {
            let covariance = DMatrix::from_element(1, 1, 1e-6);
            let mean = DVector::from_element(1, found);
            Mixture::of(&mean, &covariance, &[parameter(0.1, ANYWHERE, model_error)]).unwrap().off_neutral[0]
        };
        assert!(off(0.02, 0.0) > 0.999 && off(0.02, 0.025) < 0.3 && off(0.2, 0.025) > 0.999);
    }

    /// Two parameters that certainly differ from neutral make a third one more probable.
    #[test]
    fn what_differs_in_one_respect_is_likelier_to_differ_in_another() {
        let third = |others: f64| {
            let mean = DVector::from_row_slice(&[others, others, 0.03]);
            let covariance = DMatrix::from_diagonal_element(3, 3, 4e-4);
            Mixture::of(&mean, &covariance, &[parameter(0.1, ANYWHERE, 0.0); 3]).unwrap().off_neutral[2]
        };
        assert!(third(0.3) > third(0.0) + 0.2);
    }
}
