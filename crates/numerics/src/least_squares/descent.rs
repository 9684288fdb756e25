//! The most probable values of the unknowns of a nonlinear model: Gauss-Newton within bounds.

use crate::ROUNDING;
use crate::least_squares::damping::is_negligible;
use nalgebra::{DMatrix, DVector};

/// A model whose whitened residuals depend on unknowns. Its cost is the sum of squares of the residuals, plus the squared distance of
/// each unknown from its prior mean in standard deviations.
pub trait Model {
    /// Result of the model for values of the unknowns.
    type Point;

    /// Evaluates the model; `None` if it has no result at these values.
    fn at(&self, unknowns: &DVector<f64>) -> Option<Self::Point>;

    /// The cost of a point.
    fn cost(&self, unknowns: &DVector<f64>, point: &Self::Point) -> f64;

    /// The normal equations at a point; `reach` is the distance of the finite differences.
    fn normal(&mut self, unknowns: &DVector<f64>, point: &Self::Point, reach: DifferenceStep) -> Normal;

    /// Largest change of each unknown in one iteration: down (at most 0) and up.
    fn step_bounds(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)>;

    /// Called at each accepted point, for example to estimate the noise again.
    fn accept(&mut self, _: &Self::Point) {}
}

/// Distance of the finite differences that give the slopes of the residuals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DifferenceStep {
    /// For a smooth cost.
    Fine,
    /// For a cost with small discontinuities, which hide its slope at a short distance.
    Coarse,
}

/// Fine distance of finite differences, in the unknowns' units. Bound: both rounding and curvature errors are small.
pub const FINE: f64 = 0.02;
/// Coarse distance, which follows the curvature of the model over a fifth of an unknown's unit. Bound: far from the minimum a secant is better
/// than a tangent.
pub const COARSE: f64 = 10.0 * FINE;
/// Largest change of an unknown in one iteration, in its unit. Bound: models are nonlinear.
pub const MAX_MOVE: f64 = 2.0;

impl DifferenceStep {
    /// The distance, in the unknowns' units.
    pub fn distance(self) -> f64 {
        if self == DifferenceStep::Fine { FINE } else { COARSE }
    }
}

/// Largest change of an unknown in one iteration, down and up, that keeps it between `low` and `high`.
pub fn step_bounds_within(low: f64, high: f64, at: f64) -> (f64, f64) {
    ((low - at).clamp(-MAX_MOVE, 0.0), (high - at).clamp(0.0, MAX_MOVE))
}

/// Minimum predicted decrease of the cost for another iteration, if fits are compared with each other. Bound: 0.01 in ln of the evidence
/// is negligible.
pub const ENOUGH: f64 = 0.02;

/// Maximum number of alternations between two fits that depend on each other. Bound: each reduces the error to about a tenth.
pub const ROUNDS: usize = 3;

/// Stopping rule of a descent.
#[derive(Debug, Clone, Copy)]
pub struct Until {
    /// Maximum number of evaluations of the normal equations, the one at the result included.
    pub iterations: usize,
    /// Minimum predicted decrease of the cost for another iteration.
    pub enough: f64,
}

impl Default for Until {
    /// For fits that are compared with each other.
    fn default() -> Self {
        Until { iterations: 10, enough: ENOUGH }
    }
}

/// Result of a descent.
#[derive(Debug, Clone)]
pub struct End<Point> {
    /// The unknowns.
    pub unknowns: DVector<f64>,
    /// Result of the model.
    pub point: Point,
    /// The normal equations.
    pub normal: Normal,
    /// Predicted decrease of the cost by one more iteration; larger than [`Until::enough`] if no step decreased the cost.
    pub predicted_decrease: f64,
}

/// Maximum number of lengths tried for one step. Bound: the last is a hundredth of the step; a shorter one is no progress.
const MAX_STEP_LENGTHS: usize = 5;
/// Ratio of each length to the previous one. Bound: all of them reach a hundredth of the step.
const STEP_SHORTENING: f64 = 0.35;

/// Minimises the cost from `unknowns`, at which the model gives `point`.
pub fn descend<M: Model>(
    model: &mut M,
    mut unknowns: DVector<f64>,
    mut point: M::Point,
    until: Until,
) -> End<M::Point> {
    model.accept(&point);
    let mut reach = DifferenceStep::Fine;
    let mut normal = model.normal(&unknowns, &point, reach);
    let mut predicted_decrease = 0.0;
    for _ in 1..until.iterations {
        let Some((step, decrease)) = normal.step(&model.step_bounds(&unknowns)) else { break };
        predicted_decrease = decrease;
        let cost = model.cost(&unknowns, &point);
        if is_negligible(decrease, cost, until.enough) {
            break;
        }
        let improvement = (0..MAX_STEP_LENGTHS).find_map(|trial| {
            let unknowns = &unknowns + &step * STEP_SHORTENING.powi(trial as i32);
            let point = model.at(&unknowns)?;
            (model.cost(&unknowns, &point) < cost).then_some((unknowns, point))
        });
        match improvement {
            Some(better) => {
                (unknowns, point) = better;
                model.accept(&point);
            }
            None if reach == DifferenceStep::Coarse => break,
            None => reach = DifferenceStep::Coarse,
        }
        normal = model.normal(&unknowns, &point, reach);
    }
    End { unknowns, point, normal, predicted_decrease }
}

/// The normal equations of an iteration: half the Hessian of the cost, and half its negative gradient.
#[derive(Debug, Clone, PartialEq)]
pub struct Normal {
    /// Precision of the unknowns, priors included.
    pub matrix: DMatrix<f64>,
    /// Half the negative gradient of the cost.
    pub gradient: DVector<f64>,
}

impl Normal {
    /// The step to the minimum cost within the bounds of each unknown's change, and the predicted decrease. The unknown that exceeds its
    /// bounds most is fixed at the bound, and the others are solved again.
    pub fn step(&self, step_bounds: &[(f64, f64)]) -> Option<(DVector<f64>, f64)> {
        let mut fixed: Vec<Option<f64>> = vec![None; step_bounds.len()];
        for _ in 0..=step_bounds.len() {
            let free: Vec<usize> = (0..fixed.len()).filter(|i| fixed[*i].is_none()).collect();
            let mut step = DVector::from_fn(fixed.len(), |i, _| fixed[i].unwrap_or(0.0));
            let fixed_part = &self.matrix * &step;
            let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| self.matrix[(free[i], free[j])]);
            let right = DVector::from_fn(free.len(), |i, _| self.gradient[free[i]] - fixed_part[free[i]]);
            let solution = matrix.cholesky()?.solve(&right);
            for (place, index) in free.iter().enumerate() {
                step[*index] = solution[place];
            }
            let excess = |i: &usize| (step_bounds[*i].0 - step[*i]).max(step[*i] - step_bounds[*i].1);
            let worst = free.into_iter().max_by(|a, b| excess(a).total_cmp(&excess(b)));
            let Some(worst) = worst.filter(|i| excess(i) > ROUNDING) else {
                let predicted_decrease = 2.0 * step.dot(&self.gradient) - step.dot(&(&self.matrix * &step));
                return Some((step, predicted_decrease));
            };
            fixed[worst] =
                Some(step[worst].clamp(step_bounds[worst].0.min(0.0), step_bounds[worst].1.max(0.0)));
        }
        None
    }

    /// Half the logarithm of the determinant of the precision, which Laplace's approximation of the evidence subtracts; `None` if the
    /// precision is not positive definite.
    pub fn half_ln_determinant(&self) -> Option<f64> {
        let cholesky = self.matrix.clone().cholesky()?;
        Some(cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum())
    }

    /// Marginal covariance of the unknowns from index `first` on.
    pub fn covariance_from(&self, first: usize) -> Option<DMatrix<f64>> {
        let inverse = self.matrix.clone().cholesky()?.inverse();
        let count = inverse.nrows() - first;
        Some(inverse.view((first, first), (count, count)).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals `x - 1` and `10 (y - x^2)`, hardly any prior: the banana of Rosenbrock (1960), whose minimum is 0 at (1, 1).
    struct Banana {
        low: f64,
    }

    impl Model for Banana {
        type Point = [f64; 2];

        fn at(&self, x: &DVector<f64>) -> Option<[f64; 2]> {
            Some([x[0] - 1.0, 10.0 * (x[1] - x[0] * x[0])])
        }

        fn cost(&self, _: &DVector<f64>, residual: &[f64; 2]) -> f64 {
            residual.iter().map(|r| r * r).sum()
        }

        fn normal(&mut self, x: &DVector<f64>, residual: &[f64; 2], _: DifferenceStep) -> Normal {
            let slopes = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, -20.0 * x[0], 10.0]);
            let residual = DVector::from_row_slice(residual);
            Normal { matrix: slopes.tr_mul(&slopes), gradient: -slopes.tr_mul(&residual) }
        }

        fn step_bounds(&self, x: &DVector<f64>) -> Vec<(f64, f64)> {
            vec![(self.low - x[0], 5.0), (-5.0, 5.0)]
        }
    }

    #[test]
    fn the_minimum_is_found_within_bounds_and_at_them() {
        let until = Until { iterations: 60, enough: 1e-20 };
        let end = |low: f64, x: f64| {
            let mut banana = Banana { low };
            let start = DVector::from_row_slice(&[x, 1.0]);
            let point = banana.at(&start).unwrap();
            descend(&mut banana, start, point, until).unknowns
        };
        let free = end(-5.0, -1.2);
        assert!((free[0] - 1.0).abs() < 1e-6 && (free[1] - 1.0).abs() < 1e-6, "{free}");
        // From 1.5 on the least cost is at the bound, in the valley.
        let bound = end(1.5, 3.0);
        assert!((bound[0] - 1.5).abs() < 1e-6 && (bound[1] - 2.25).abs() < 1e-6, "{bound}");
    }

    /// Against all ways of holding unknowns at their bounds.
    #[test]
    fn a_step_within_room_solves_for_the_others() {
        let matrix = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.5, 1.0, 3.0, 0.2, 0.5, 0.2, 2.0]);
        let normal = Normal { matrix: matrix.clone(), gradient: DVector::from_row_slice(&[8.0, -1.0, 1.0]) };
        let (step, predicted_decrease) = normal.step(&[(-1.0, 1.0); 3]).unwrap();
        assert!((step[0] - 1.0).abs() < 1e-12);
        // The gradient vanishes along what is free.
        let gradient = &matrix * &step - &normal.gradient;
        assert!(gradient[1].abs() < 1e-12 && gradient[2].abs() < 1e-12);
        let cost = |s: &DVector<f64>| s.dot(&(&matrix * s)) - 2.0 * s.dot(&normal.gradient);
        assert!((predicted_decrease + cost(&step)).abs() < 1e-12);
        for axis in 0..3 {
            for by in [-0.01, 0.01] {
                let mut other = step.clone();
                other[axis] = (other[axis] + by).clamp(-1.0, 1.0);
                assert!(cost(&other) >= cost(&step) - 1e-12);
            }
        }
    }
}
