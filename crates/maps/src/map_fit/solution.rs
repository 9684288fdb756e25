//! Solves a fit: Levenberg-Marquardt steps in turn with updates of the variances. The solution has parameters at any speed, with their covariance.
//!
//! The variance components are estimated by marginal likelihood: the penalty of each parameter over speed, the scatter of the lines and the two
//! residual scales together with the fit, by the update of S. N. Wood and M. Fasiolo ("A generalized Fellner-Schall method for smoothing
//! parameter optimization", Biometrics 73 (2017) 1071-1081). The number of lines thereby determines the detail over speed: parameters that a map
//! does not determine stay straight.

use crate::map_fit::MapFitError;
use crate::map_fit::observations::Observations;
use crate::map_fit::problem::{
    LINE_OFFSETS, Precisions, Problem, ROBUST_SIGMAS, ROUGHNESS_PRECISION_RANGE, Unknowns,
};
use crate::map_fit::speed_lines::{
    End, EndWidenings, FlowFrame, LineShape, NO_WIDENING, PARAMETERS, Parameters, Splines, WORK, Widening,
};
use mapper_numerics::least_squares::{Damping, DampingRule, damped_step, inverse};
use mapper_numerics::statistics::{NORMAL_975, SHARE_975, student_quantile};
use nalgebra::{DMatrix, DVector};

#[derive(Debug, Clone)]
pub(crate) struct Solution {
    pub splines: Splines,
    pub frame: FlowFrame,
    pub(crate) values: DMatrix<f64>,
    pub(crate) covariance: DMatrix<f64>,
    roughness_variance: Parameters,
    pub(crate) widening: EndWidenings,
    /// Standard deviations of the line offsets, logarithms.
    pub line_scatter: [f64; 3],
    /// Scales of distance and efficiency that weight the residuals.
    pub(crate) scales: [f64; 2],
    /// Root mean squares of distance and efficiency.
    pub rms: [f64; 2],
    /// Minus twice the logarithm of the marginal likelihood by Laplace's approximation, up to a constant of the data.
    deviance: f64,
    /// Highest efficiency of the fit at the points, fraction.
    pub best_eta: f64,
    pub angles_rad: Vec<f64>,
}

impl Solution {
    pub(crate) fn parameters(&self, speed_ratio: f64) -> Parameters {
        let rows = self.splines.rows(speed_ratio);
        std::array::from_fn(|q| self.values.row(q).transpose().dot(rows.of(q)))
    }

    pub(crate) fn shape(&self, speed_ratio: f64) -> LineShape {
        LineShape::new(&self.parameters(speed_ratio), self.frame)
    }

    /// Widening at a speed: that of the end beyond which it lies.
    fn widening_at(&self, speed_ratio: f64) -> Widening {
        match self.splines.shape.nearest_end(speed_ratio) {
            None => NO_WIDENING,
            Some(End::Slow) => self.widening.slow,
            Some(End::Fast) => self.widening.fast,
        }
    }

    /// Covariance of the parameters at a speed: of the surface, of a line about it, and of the prior between and beyond the knots.
    /// Beyond them a trend may fade like the surface's, continue straight, or anything between with equal probability: the mean square
    /// deviation from the surface is a third of the squared difference.
    pub(crate) fn covariance(&self, speed_ratio: f64) -> DMatrix<f64> {
        let (rows, knots) = (self.splines.rows(speed_ratio), self.splines.len());
        // Student's quantile over the normal one, squared, for the number of second differences that estimated the roughness.
        let freedom = knots.saturating_sub(2).max(1) as f64;
        let small_sample_factor =
            student_quantile(SHARE_975, freedom).map_or(1.0, |quantile| (quantile / NORMAL_975).powi(2));
        let prior_variances =
            (self.splines.shape.prior_variance(speed_ratio), self.splines.work.prior_variance(speed_ratio));
        let widening = self.widening_at(speed_ratio);
        let trends = [
            self.splines.shape.straight_minus_damped(speed_ratio),
            self.splines.work.straight_minus_damped(speed_ratio),
        ];
        let mut out = DMatrix::zeros(PARAMETERS, PARAMETERS);
        for a in 0..PARAMETERS {
            for b in 0..PARAMETERS {
                let block = self.covariance.view((a * knots, b * knots), (knots, knots));
                out[(a, b)] = (rows.of(a).transpose() * block * rows.of(b))[(0, 0)];
            }
            let (prior_variance, trend, factor) = if a < WORK {
                (prior_variances.0, &trends[0], widening.shape)
            } else {
                (prior_variances.1, &trends[1], widening.work)
            };
            let difference = self.values.row(a).transpose().dot(trend);
            out[(a, a)] += factor
                * (prior_variance * self.roughness_variance[a] * small_sample_factor
                    + difference * difference / 3.0);
        }
        for (index, parameters) in LINE_OFFSETS.iter().enumerate() {
            for (a, b) in parameters.iter().flat_map(|a| parameters.iter().map(move |b| (*a, *b))) {
                out[(a, b)] += self.line_scatter[index].powi(2);
            }
        }
        out
    }
}

/// Relative gain of a round below which the variances are estimated. Bound: effort.
const FREE_GAIN_RATIO: f64 = 1e-2;
/// Relative gain below which they have converged. Bound: effort.
const ESTIMATE_GAIN_RATIO: f64 = 1e-3;
/// Relative gain below which the fit has converged. Bound: the parameters then move by a hundredth of their errors.
const SETTLED_GAIN_RATIO: f64 = 1e-4;

/// Rounds with fixed variances, rounds that estimate the variances, and final rounds with the last variances. Bound: the fit converges
/// before.
const ROUNDS: [usize; 3] = [8, 22, 15];
/// Maximum relative change of a variance component after convergence. Bound: a tenth of the error of a variance from the usual number of
/// lines.
const MAX_RELATIVE_CHANGE: f64 = 0.05;
/// Starting scatter of whole lines. Bound: small, since on a map of few lines a large one would absorb the shape.
const START_LINE_SCATTER: f64 = 0.005;
/// Starting scales of the residuals: the first always, the others if the result is above [`MAX_RMS`]. Bound: start values.
const START_SCALES: [f64; 3] = [0.01, 0.003, 0.02];
/// Root mean square of distance or efficiency above which the fit is repeated from other scales. Bound: twice that of usual maps.
const MAX_RMS: f64 = 0.006;
/// Starting roughness of each parameter over speed. Bound: start values, which the data change by up to thirty times
/// ([`ROUGHNESS_PRECISION_RANGE`]); in the order of the prior standard deviations of the levels, as second derivative over the logarithm
/// of speed.
const START_ROUGHNESS: Parameters = [0.5, 0.5, 3.0, 1.0, 1.5, 1.5, 0.15, 0.15, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5];

/// Damping of the steps. Bound: strong, since nearest places and weights change between rounds; the minimum does not depend on it.
const DAMPING: DampingRule = DampingRule {
    start: 1e-2,
    growth: 5.0,
    reduction: 0.2,
    min_after_rejection: 1e-6,
    min: 1e-9,
    max: f64::INFINITY,
    max_trials: 6,
};

#[derive(Clone, Copy)]
enum Start<'a> {
    /// From the points alone, with this scale of the residuals.
    Scale(f64),
    Fit(&'a Solution),
}

enum Phase {
    /// Parameters with fixed starting variances.
    Free,
    Estimate,
    Settle,
}

/// Solves the fit. `stiffness` (at least 1) multiplies the smallest penalty that the estimation may choose.
///
/// If the residuals stay large, the estimation may have taken shape for scatter or points for outliers. It is then repeated from other
/// scales, and the most probable result counts.
///
/// `start`: a fit of nearly the same points, from which the search starts.
pub(crate) fn solve(
    data: &Observations,
    stiffness: f64,
    start: Option<&Solution>,
) -> Result<Solution, MapFitError> {
    let frame = start.map(|fit| fit.frame);
    let from = |start: Start<'_>| solve_from(data, stiffness, frame, start);
    let [first, others @ ..] = START_SCALES.map(Start::Scale);
    let mut best = from(start.map_or(first, Start::Fit))?;
    if best.rms[0] > MAX_RMS || best.rms[1] > MAX_RMS {
        for start in start.map(|_| first).into_iter().chain(others) {
            if let Ok(other) = from(start)
                && other.deviance < best.deviance
            {
                best = other;
            }
        }
    }
    Ok(best)
}

fn solve_from(
    data: &Observations,
    stiffness: f64,
    frame: Option<FlowFrame>,
    start: Start<'_>,
) -> Result<Solution, MapFitError> {
    let mut problem = Problem::new(data, frame);
    let start_rough: Parameters = START_ROUGHNESS.map(|r| stiffness / (r * r));
    let mut unknowns = problem.initial()?;
    problem.start =
        std::array::from_fn(|q| if q < WORK { problem.start[q] } else { unknowns.values[(q, 0)] });
    let mut precisions = match start {
        Start::Scale(scale) => Precisions {
            rough: start_rough,
            lines: [1.0 / START_LINE_SCATTER.powi(2); 3],
            scales: [scale; 2],
        },
        Start::Fit(fit) => {
            unknowns.values = problem.splines.values(|speed_ratio| fit.parameters(speed_ratio));
            Precisions {
                rough: std::array::from_fn(|q| {
                    let [min, max] = ROUGHNESS_PRECISION_RANGE.map(|ratio| ratio * start_rough[q]);
                    (1.0 / fit.roughness_variance[q]).clamp(min, max)
                }),
                lines: fit.line_scatter.map(|sigma| 1.0 / (sigma * sigma)),
                scales: fit.scales,
            }
        }
    };
    let mut feet = problem.feet(&unknowns, None);
    let mut damping = Damping::new(DAMPING);
    let [free, estimate, settle] = ROUNDS;
    let mut phase = Phase::Free;
    for round in 0..free + estimate + settle {
        let residuals = problem.residuals(&feet);
        let weights = problem.weights(&residuals, &precisions.scales);
        let jacobian = problem.jacobian(&unknowns, &feet, &weights);
        let (penalty, gradient) = problem.penalty(&unknowns, &precisions);
        let scaled = DVector::from_iterator(
            2 * residuals.len(),
            residuals.iter().zip(&weights).flat_map(|(r, w)| [r[0] * w[0].sqrt(), r[1] * w[1].sqrt()]),
        );
        let transposed = jacobian.transpose();
        let gradient = &transposed * scaled + gradient;
        // Not tr_mul: the product of two matrices uses the faster kernels of matrixmultiply.
        let normal_matrix = transposed * &jacobian + &penalty;
        let cost = problem.cost(&residuals, &weights) + problem.penalty_value(&unknowns, &precisions);
        let right = -gradient;
        let better = damping.search(|damping| {
            let next = problem.stepped(&unknowns, &damped_step(&normal_matrix, &right, damping)?);
            let next_feet = problem.feet(&next, Some(&feet));
            let next_cost = problem.cost(&problem.residuals(&next_feet), &weights)
                + problem.penalty_value(&next, &precisions);
            (next_cost < cost).then_some((next, next_feet, next_cost))
        });
        let gain = better.as_ref().map_or(0.0, |(.., next_cost)| cost - next_cost);
        if let Some((next, next_feet, _)) = better {
            (unknowns, feet) = (next, next_feet);
        }
        match phase {
            Phase::Free if round + 1 >= free || gain < FREE_GAIN_RATIO * cost => phase = Phase::Estimate,
            Phase::Estimate => {
                let inverse = inverse(&normal_matrix.cholesky().ok_or(MapFitError::Singular)?);
                let residuals = problem.residuals(&feet);
                let change =
                    problem.update(&mut precisions, &unknowns, &inverse, &jacobian, &residuals, &start_rough);
                if round + 1 >= free + estimate
                    || (change < MAX_RELATIVE_CHANGE && gain < ESTIMATE_GAIN_RATIO * cost)
                {
                    // A nearest place may be a local minimum on a wrong part of the line: search the whole line again.
                    feet = problem.feet(&unknowns, None);
                    phase = Phase::Settle;
                }
            }
            Phase::Settle if gain < SETTLED_GAIN_RATIO * cost => break,
            _ => {}
        }
    }
    let residuals = problem.residuals(&feet);
    let jacobian = problem.jacobian(&unknowns, &feet, &problem.weights(&residuals, &precisions.scales));
    let information = jacobian.transpose() * &jacobian + problem.penalty(&unknowns, &precisions).0;
    let factor = information.cholesky().ok_or(MapFitError::Singular)?;
    let deviance = problem.deviance(&unknowns, &precisions, &residuals)
        + 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    let covariance = inverse(&factor);
    // Residuals of the smooth surface without line offsets, since users evaluate that surface.
    let smooth =
        Unknowns { offsets: DMatrix::zeros(LINE_OFFSETS.len(), data.lines_rpm.len()), ..unknowns.clone() };
    let smooth_feet = problem.feet(&smooth, Some(&feet));
    Ok(Solution {
        widening: EndWidenings::NONE,
        rms: problem.rms(&problem.residuals(&smooth_feet)),
        deviance,
        best_eta: smooth_feet.iter().map(|foot| foot.place.eta).fold(0.0, f64::max),
        angles_rad: smooth_feet.iter().map(|foot| foot.angle_rad).collect(),
        splines: problem.splines,
        frame: problem.frame,
        values: unknowns.values,
        covariance,
        roughness_variance: precisions.rough.map(|p| 1.0 / p),
        line_scatter: precisions.lines.map(|p| 1.0 / p.sqrt()),
        scales: precisions.scales,
    })
}

/// Minimum degrees of freedom of a variance. Bound: excludes division by zero.
const MIN_FREEDOM: f64 = 1e-2;
/// Minimum sum of squares. Bound: excludes division by zero.
const SMALL: f64 = 1e-9;
/// Largest change of the precision of a roughness in one round, down and up. Bound: the path only; the result does not depend on it.
const ROUGHNESS_STEP: (f64, f64) = (0.3, 3.0);
/// Precisions of line offsets: of 3 % and of 0.05 %. Bound: a smaller scatter is not an error of speed, a larger one would be another machine.
const LINE_PRECISIONS: (f64, f64) = (1.0 / 9e-4, 4e6);
/// Minimum degrees of freedom of residuals, share of the points. Bound: a line of few points has residuals that the fit has absorbed.
const MIN_FREEDOM_SHARE: f64 = 0.25;
/// Largest change of a scale in one round, down and up. Bound: the path only.
const SCALE_STEP: (f64, f64) = (0.7, 1.2);
/// Range of the scales of residuals. Bound: repeated points scatter by 0.2 % at least; above 3 % they are no map.
const SCALES: (f64, f64) = (1e-3, 0.03);

impl Problem<'_> {
    /// The deviance of the solution without the determinant of the information.
    fn deviance(&self, unknowns: &Unknowns, precisions: &Precisions, residuals: &[[f64; 2]]) -> f64 {
        let mut sum = self.penalty_value(unknowns, precisions);
        for (p, r) in self.data.points.iter().zip(residuals) {
            let scales = precisions.scales.map(|s| s * s);
            let loss = |variance: f64, r: f64| {
                variance.ln()
                    + ROBUST_SIGMAS
                        * ROBUST_SIGMAS
                        * (r * r / variance / (ROBUST_SIGMAS * ROBUST_SIGMAS)).ln_1p()
            };
            sum += loss(scales[0], r[0]);
            if p.eta.is_some() {
                sum += loss(scales[1] + p.eta_error * p.eta_error, r[1]);
            }
        }
        let free = self.splines.len().saturating_sub(2) as f64;
        sum -= precisions.rough.iter().map(|p| free * p.ln()).sum::<f64>();
        sum - precisions.lines.iter().map(|p| self.data.lines_rpm.len() as f64 * p.ln()).sum::<f64>()
    }

    /// Updates the variance components once; returns the largest relative change.
    fn update(
        &self,
        precisions: &mut Precisions,
        unknowns: &Unknowns,
        inverse: &DMatrix<f64>,
        jacobian: &DMatrix<f64>,
        residuals: &[[f64; 2]],
        start_rough: &Parameters,
    ) -> f64 {
        let (knots, lines) = (self.splines.len(), self.data.lines_rpm.len());
        let mut change = 0.0f64;
        let mut set = |precision: &mut f64, next: f64| {
            change = change.max((next / *precision - 1.0).abs());
            *precision = next;
        };
        for (q, start) in start_rough.iter().enumerate() {
            let values = unknowns.values.row(q).transpose();
            let block = inverse.view((q * knots, q * knots), (knots, knots));
            let used = precisions.rough[q] * (block * &self.splines.of(q).penalty).trace();
            let free = (knots.saturating_sub(2) as f64 - used).max(MIN_FREEDOM);
            let wanted = free / (values.dot(&(&self.splines.of(q).penalty * &values)) + SMALL);
            let step = (wanted / precisions.rough[q]).clamp(ROUGHNESS_STEP.0, ROUGHNESS_STEP.1);
            let [min, max] = ROUGHNESS_PRECISION_RANGE.map(|ratio| ratio * start);
            let next = (precisions.rough[q] * step).clamp(min, max);
            set(&mut precisions.rough[q], next);
        }
        for (index, precision) in precisions.lines.iter_mut().enumerate() {
            let first = PARAMETERS * knots + index * lines;
            let trace: f64 = (first..first + lines).map(|i| inverse[(i, i)]).sum();
            let wanted = (lines as f64 - *precision * trace).max(MIN_FREEDOM)
                / (unknowns.offsets.row(index).norm_squared() + SMALL);
            let next = (*precision * (wanted / *precision).clamp(0.5, 2.0))
                .clamp(LINE_PRECISIONS.0, LINE_PRECISIONS.1);
            set(precision, next);
        }
        let projected = jacobian * inverse;
        for c in 0..2 {
            let mut sum = [0.0; 3];
            for (i, (p, r)) in self.data.points.iter().zip(residuals).enumerate() {
                if c == 1 && p.eta.is_none() {
                    continue;
                }
                let own = if c == 1 { p.eta_error.powi(2) } else { 0.0 };
                let variance = precisions.scales[c].powi(2) + own;
                let robust = 1.0 / (1.0 + r[c] * r[c] / variance / (ROBUST_SIGMAS * ROBUST_SIGMAS));
                // A point's declared error is not scatter of the fit.
                let share = precisions.scales[c].powi(2) / variance;
                let leverage = projected.row(2 * i + c).dot(&jacobian.row(2 * i + c));
                sum[0] += robust * share * share * (r[c] * r[c] - own).max(0.0);
                sum[1] += robust * share * share;
                sum[2] += (leverage * share * share).min(1.0);
            }
            let degrees = (sum[1] - sum[2]).max(MIN_FREEDOM_SHARE * sum[1]).max(SMALL);
            let wanted = (sum[0] / degrees).sqrt();
            let scale = precisions.scales[c];
            set(
                &mut precisions.scales[c],
                wanted.clamp((SCALE_STEP.0 * scale).max(SCALES.0), (SCALE_STEP.1 * scale).min(SCALES.1)),
            );
        }
        change
    }
}
