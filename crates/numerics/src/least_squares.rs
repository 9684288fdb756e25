//! Damped least squares: step control, descent, and the arrow structure.
//!
//! [`descend`] is the fit of a model whose runs are costly: undamped steps within bounds, shortened if they do not help.
//!
//! The caller defines the problem: residuals, weights, bounds, and estimates between the steps. docs/decisions/0010-numerics.md gives
//! the reasons for not using a library.
//!
//! Source: K. Levenberg, Quarterly of Applied Mathematics 2 (1944); D. W. Marquardt, SIAM Journal 11 (1963), whose damping is
//! relative to the diagonal, so that units of the parameters do not matter.

use crate::ROUNDING;
use nalgebra::{Cholesky, Const, DMatrix, DVector, Dyn, OMatrix, SMatrix, SVector};

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

// Normal equations with an arrow-shaped matrix: many groups of a few parameters each, coupled only through parameters that all groups
// share. The groups are eliminated one by one, so that the work grows with their number, not with its cube.
// Source: B. Triggs, P. McLauchlan, R. Hartley, A. Fitzgibbon, "Bundle adjustment - a modern synthesis" (2000), section 6.1,
// which calls the result the reduced camera system.

/// The normal equations of one group with `L` own parameters.
#[derive(Debug, Clone)]
pub struct ArrowBlock<const L: usize> {
    /// Block of the group's own parameters.
    pub own: SMatrix<f64, L, L>,
    /// Block between the group's own parameters and the shared ones.
    pub mixed: OMatrix<f64, Const<L>, Dyn>,
    /// Right-hand side.
    pub right: SVector<f64, L>,
    /// Whether the group contributes to the estimate of the shared parameters.
    pub contributes: bool,
}

/// The normal equations of all parameters.
#[derive(Debug, Clone)]
pub struct Arrow<const L: usize> {
    /// Block of the shared parameters, before the groups are eliminated.
    pub shared: DMatrix<f64>,
    /// Right-hand side of the shared parameters.
    pub right: DVector<f64>,
    /// The groups.
    pub blocks: Vec<ArrowBlock<L>>,
}

/// The equations of the shared parameters after elimination of the groups.
#[derive(Debug, Clone)]
pub struct Reduced<const L: usize> {
    /// The Schur complement.
    pub matrix: DMatrix<f64>,
    /// Right-hand side.
    pub right: DVector<f64>,
    /// Inverse of each group's own matrix.
    pub inverses: Vec<SMatrix<f64, L, L>>,
}

impl<const L: usize> Arrow<L> {
    /// Eliminates the groups, with the diagonal multiplied by `1 + damping`; `None` if a group's own matrix is not
    /// positive definite.
    pub fn reduced(&self, damping: f64) -> Option<Reduced<L>> {
        let (mut matrix, mut right) = (self.shared.clone(), self.right.clone());
        for i in 0..matrix.nrows() {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let mut inverses = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let mut own = block.own;
            for i in 0..L {
                own[(i, i)] *= 1.0 + damping;
            }
            let inverse = own.cholesky()?.inverse();
            if block.contributes {
                let eliminated = block.mixed.transpose() * inverse;
                matrix -= &eliminated * &block.mixed;
                right -= &eliminated * block.right;
            }
            inverses.push(inverse);
        }
        Some(Reduced { matrix, right, inverses })
    }

    /// The damped step of the shared parameters and of each group's own; `None` if the equations cannot be solved.
    pub fn step(&self, damping: f64) -> Option<(DVector<f64>, Vec<SVector<f64, L>>)> {
        let Reduced { matrix, right, inverses } = self.reduced(damping)?;
        let shared = if matrix.nrows() == 0 { DVector::zeros(0) } else { matrix.cholesky()?.solve(&right) };
        let own = self
            .blocks
            .iter()
            .zip(&inverses)
            .map(|(block, inverse)| inverse * (block.right - &block.mixed * &shared))
            .collect();
        Some((shared, own))
    }
}

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

#[cfg(test)]
mod arrow_tests {
    use super::*;
    use crate::least_squares::damped_step;

    /// Any numbers that make a matrix of full rank.
    fn column(row: usize, column: usize) -> f64 {
        ((1 + row * 7 + column * 13 + row * column) as f64).sin()
    }

    /// Three groups of two parameters under three shared ones, from an explicit Jacobian of 30 rows.
    fn example() -> (Arrow<2>, DMatrix<f64>, DVector<f64>) {
        let mut jacobian = DMatrix::zeros(30, 9);
        for row in 0..30 {
            for shared in 0..3 {
                jacobian[(row, shared)] = column(row, shared);
            }
            for own in 0..2 {
                jacobian[(row, 3 + 2 * (row / 10) + own)] = column(row, 3 + own);
            }
        }
        let residual = DVector::from_fn(30, |row, _| column(row, 40));
        let (normal, right) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&residual));
        let blocks = (0..3)
            .map(|group| ArrowBlock {
                own: normal.fixed_view::<2, 2>(3 + 2 * group, 3 + 2 * group).into_owned(),
                mixed: normal.fixed_rows::<2>(3 + 2 * group).columns(0, 3).into_owned(),
                right: right.fixed_rows::<2>(3 + 2 * group).into_owned(),
                contributes: true,
            })
            .collect();
        let arrow = Arrow {
            shared: normal.view((0, 0), (3, 3)).into_owned(),
            right: right.rows(0, 3).into_owned(),
            blocks,
        };
        (arrow, normal, right)
    }

    #[test]
    fn the_step_is_that_of_the_full_equations() {
        let (arrow, normal, right) = example();
        for damping in [0.0, 1e-3, 10.0] {
            let full = damped_step(&normal, &right, damping).unwrap();
            let (shared, own) = arrow.step(damping).unwrap();
            let own = own.iter().flat_map(|part| part.iter());
            for (found, expected) in shared.iter().chain(own).zip(full.iter()) {
                assert!((found - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_reduced_matrix_is_the_inverse_of_the_shared_covariance() {
        let (arrow, normal, _) = example();
        let covariance = arrow.reduced(0.0).unwrap().matrix.cholesky().unwrap().inverse();
        let full = normal.cholesky().unwrap().inverse();
        assert!((covariance - full.view((0, 0), (3, 3))).abs().max() < 1e-12);
    }

    /// A group without a say leaves the shared step as if it were not there, and takes its own best place for that step.
    #[test]
    fn a_group_without_a_say_only_follows() {
        let (mut arrow, ..) = example();
        let without = Arrow { blocks: arrow.blocks[..2].to_vec(), ..arrow.clone() };
        arrow.blocks[2].contributes = false;
        let ((shared, own), (expected, _)) = (arrow.step(0.0).unwrap(), without.step(0.0).unwrap());
        assert_eq!(shared, expected);
        let last = &arrow.blocks[2];
        assert!((last.own * own[2] - (last.right - &last.mixed * shared)).norm() < 1e-12);
    }

    #[test]
    fn without_shared_parameters_and_without_a_solution() {
        let (arrow, ..) = example();
        let blocks = arrow
            .blocks
            .iter()
            .map(|block| ArrowBlock { mixed: OMatrix::<f64, Const<2>, Dyn>::zeros(0), ..block.clone() });
        let alone =
            Arrow { shared: DMatrix::zeros(0, 0), right: DVector::zeros(0), blocks: blocks.collect() };
        let (shared, own) = alone.step(0.0).unwrap();
        assert!(shared.is_empty() && own.len() == 3);
        let mut broken = arrow;
        broken.blocks[0].own = SMatrix::zeros();
        assert!(broken.step(1.0).is_none());
    }
}

#[cfg(test)]
mod descent_tests {
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
