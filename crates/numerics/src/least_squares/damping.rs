//! Levenberg-Marquardt damping, the search for a step that reduces the cost, and the stopping rule; dense normal equations.

use crate::ROUNDING;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// How the damping changes during a fit. Damping is a fraction of the diagonal of the normal matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DampingRule {
    /// Initial value.
    pub start: f64,
    /// Factor after a rejected step, above 1.
    pub growth: f64,
    /// Factor after an accepted step, below 1.
    pub reduction: f64,
    /// Minimum after a rejected step, so that a very small damping grows back in few trials.
    pub min_after_rejection: f64,
    /// Minimum after an accepted step.
    pub min: f64,
    /// Maximum: beyond it steps are too short to change anything, and the search ends.
    pub max: f64,
    /// Maximum number of trial steps of a search.
    pub max_trials: usize,
}

impl DampingRule {
    /// For a good start and a nearly linear model. Bound: starts small and quickly becomes negligible; the minimum does not depend on it.
    pub const GOOD_START: DampingRule = DampingRule {
        start: 1e-4,
        growth: 10.0,
        reduction: 0.1,
        min_after_rejection: 1e-8,
        min: 1e-12,
        max: 1e8,
        max_trials: 12,
    };
}

/// Maximum number of iterations of a fit. Bound: a good start needs about ten.
const MAX_ITERATIONS: usize = 60;

/// The stopping rule of every fit: an iteration decreases the cost, as predicted or as found, by no more than `enough`, or than rounding of the
/// cost.
pub fn is_negligible(decrease: f64, cost: f64, enough: f64) -> bool {
    decrease <= enough.max(ROUNDING * cost)
}

/// The damping during a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Damping {
    rule: DampingRule,
    value: f64,
}

impl Damping {
    /// Starts with the initial damping of a rule.
    pub fn new(rule: DampingRule) -> Self {
        Damping { rule, value: rule.start }
    }

    /// Tries steps with increasing damping until `trial` accepts one. `trial` gets the damping and returns `None` if the equations cannot
    /// be solved or the step does not reduce the cost. Returns `None` if no step is accepted.
    ///
    /// The next search starts from the accepted damping, reduced.
    pub fn search<T>(&mut self, mut trial: impl FnMut(f64) -> Option<T>) -> Option<T> {
        for _ in 0..self.rule.max_trials {
            if let Some(found) = trial(self.value) {
                self.value = (self.value * self.rule.reduction).max(self.rule.min);
                return Some(found);
            }
            self.value = (self.value * self.rule.growth).max(self.rule.min_after_rejection);
            if self.value > self.rule.max {
                break;
            }
        }
        None
    }
}

/// A sum of squares at its current place, to be minimised by damped steps.
pub trait DampedFit {
    /// Normal equations, dense or arrow-shaped.
    type Equations;
    /// Values of the unknowns.
    type Place;

    /// Cost and normal equations at the current place; `None` if they are not finite.
    fn linearise(&self) -> Option<(f64, Self::Equations)>;

    /// The place after a damped step, and its cost; `None` if the equations cannot be solved or the cost is above `cost`, that of the current
    /// place.
    fn step(&self, equations: &Self::Equations, cost: f64, damping: f64) -> Option<(Self::Place, f64)>;

    /// Moves to a place; `None` if nothing is defined there.
    fn move_to(&mut self, place: Self::Place) -> Option<()>;
}

/// Minimises the cost from the current place, until an iteration decreases it by `enough` or less. Returns the cost; `None` if the fit has no
/// equations.
pub fn minimise<F: DampedFit>(fit: &mut F, enough: f64) -> Option<f64> {
    let mut damping = Damping::new(DampingRule::GOOD_START);
    let mut best = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let (cost, equations) = fit.linearise()?;
        best = cost;
        let trial = |damping| fit.step(&equations, cost, damping);
        let Some((place, lower)) = damping.search(trial) else { break };
        fit.move_to(place)?;
        best = lower;
        if is_negligible(cost - lower, lower, enough) {
            break;
        }
    }
    Some(best)
}

/// The step `x` of `(A + damping diag A) x = b`, with A the normal matrix and b the right side (the negative half gradient);
/// `None` if the system cannot be solved or the step is not finite.
pub fn damped_step(normal: &DMatrix<f64>, right: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let mut damped = normal.clone();
    for i in 0..damped.nrows() {
        damped[(i, i)] *= 1.0 + damping;
    }
    let step = damped.cholesky()?.solve(right);
    step.iter().all(|value| value.is_finite()).then_some(step)
}

/// Inverse of a factored matrix, as a product of two: three times as fast as one solution for each column.
pub fn inverse(factor: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
    let lower = factor.l_dirty();
    let mut inverse = DMatrix::identity(lower.nrows(), lower.nrows());
    // A Cholesky factor has no 0 on its diagonal.
    lower.solve_lower_triangular_mut(&mut inverse);
    inverse.transpose() * &inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: DampingRule = DampingRule {
        start: 1e-2,
        growth: 10.0,
        reduction: 0.1,
        min_after_rejection: 1e-6,
        min: 1e-8,
        max: 1e3,
        max_trials: 12,
    };

    #[test]
    fn the_search_grows_until_something_helps_and_starts_relieved_next_time() {
        let mut damping = Damping::new(RULE);
        let mut tried = Vec::new();
        let found = damping.search(|value| {
            tried.push(value);
            (value > 0.5).then_some("helps")
        });
        assert_eq!((found, tried.len()), (Some("helps"), 3));
        assert_eq!(damping.search(Some), Some(tried[2] * 0.1));
    }

    #[test]
    fn it_ends_at_the_largest_damping_and_after_so_many_tries() {
        let mut count = 0;
        let mut never = |_: f64| -> Option<()> {
            count += 1;
            None
        };
        assert_eq!(Damping::new(RULE).search(&mut never), None);
        assert_eq!(Damping::new(DampingRule { max: f64::INFINITY, ..RULE }).search(&mut never), None);
        // 1e-2 to 1e3 in factors of ten, and the tries allowed.
        assert!((6..=7).contains(&(count - 12)), "{count}");
    }

    #[test]
    fn relief_and_renewal_have_their_floors() {
        let mut damping = Damping::new(RULE);
        for _ in 0..20 {
            damping.search(Some);
        }
        assert_eq!(damping.search(Some), Some(1e-8));
        let mut tried = Vec::new();
        damping.search(|value| {
            tried.push(value);
            (tried.len() == 2).then_some(())
        });
        assert_eq!(tried, [1e-8, 1e-6]);
    }

    /// NIST StRD, Misra1a (lower difficulty): `y = b1 (1 - exp(-b2 x))`, 14 observations of a dental study; certified values
    /// from the first, far start.
    #[test]
    fn misra1a_comes_to_the_certified_values() {
        const X: [f64; 14] =
            [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0];
        const Y: [f64; 14] = [
            10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78,
        ];
        let residuals =
            |b: &DVector<f64>| DVector::from_fn(14, |i, _| Y[i] - b[0] * (1.0 - (-b[1] * X[i]).exp()));
        let jacobian = |b: &DVector<f64>| {
            DMatrix::from_fn(14, 2, |i, j| {
                let decay = (-b[1] * X[i]).exp();
                if j == 0 { 1.0 - decay } else { b[0] * X[i] * decay }
            })
        };
        let mut b = DVector::from_vec(vec![500.0, 1e-4]);
        let mut damping = Damping::new(DampingRule {
            start: 1e-3,
            growth: 10.0,
            reduction: 0.1,
            min_after_rejection: 1e-9,
            min: 1e-14,
            max: 1e8,
            max_trials: 20,
        });
        for _ in 0..50 {
            let (r, j) = (residuals(&b), jacobian(&b));
            let (normal, right) = (j.tr_mul(&j), j.tr_mul(&r));
            let trial = |damping| {
                let next = &b + damped_step(&normal, &right, damping)?;
                (residuals(&next).norm_squared() < r.norm_squared()).then_some(next)
            };
            let Some(next) = damping.search(trial) else { break };
            b = next;
        }
        // Certified to eleven digits; where the cost no longer falls the parameters have half of a double's.
        assert!((b[0] / 2.389_421_291_8e2 - 1.0).abs() < 1e-7, "{b}");
        assert!((b[1] / 5.501_564_318_1e-4 - 1.0).abs() < 1e-7, "{b}");
        assert!((residuals(&b).norm_squared() / 1.245_513_889_4e-1 - 1.0).abs() < 1e-9);
        // Certified standard deviations of the parameters, from the inverse.
        let j = jacobian(&b);
        let covariance = inverse(&j.tr_mul(&j).cholesky().unwrap()) * (residuals(&b).norm_squared() / 12.0);
        assert!((covariance[(0, 0)].sqrt() / 2.707_007_524_1 - 1.0).abs() < 1e-6);
        assert!((covariance[(1, 1)].sqrt() / 7.266_868_814_9e-6 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_cannot_be_solved_is_reported() {
        let right = DVector::from_vec(vec![1.0, 1.0]);
        assert_eq!(damped_step(&DMatrix::zeros(2, 2), &right, 1e-3), None);
        assert_eq!(damped_step(&DMatrix::identity(2, 2), &(right * f64::NAN), 0.0), None);
    }
}
