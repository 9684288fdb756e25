//! Solution of a fit: parameters at any speed, with their covariance.

use crate::map_fit::least_squares::problem::LINE_OFFSETS;
use crate::map_fit::speed_lines::ends::{End, EndWidenings, NO_WIDENING, Widening};
use crate::map_fit::speed_lines::line_shape::{FlowFrame, LineShape, PARAMETERS, Parameters, WORK};
use crate::map_fit::speed_lines::splines::Splines;
use mapper_numerics::statistics::SHARE_975;
use mapper_numerics::statistics::{NORMAL_975, student_quantile};
use nalgebra::DMatrix;

/// A solved problem.
#[derive(Debug, Clone)]
pub(crate) struct Solution {
    pub splines: Splines,
    pub frame: FlowFrame,
    /// Parameters at the knots.
    pub(crate) values: DMatrix<f64>,
    /// Covariance of all unknowns, parameters first (parameter by parameter, knot by knot).
    pub(crate) covariance: DMatrix<f64>,
    /// Variance of the roughness: the inverse of its penalty.
    pub(crate) roughness_variance: Parameters,
    /// Widening of the errors beyond the measured speeds.
    pub(crate) widening: EndWidenings,
    /// Standard deviations of the line offsets, logarithms.
    pub line_scatter: [f64; 3],
    /// Scales of distance and efficiency that weight the residuals.
    pub(crate) scales: [f64; 2],
    /// Root mean squares of distance and efficiency.
    pub rms: [f64; 2],
    /// Minus twice the logarithm of the marginal likelihood by Laplace's approximation, up to a constant of the data.
    pub(crate) deviance: f64,
    /// Highest efficiency of the fit at the points, fraction.
    pub best_eta: f64,
    /// Angles of the feet, in the order of the points.
    pub angles_rad: Vec<f64>,
}

impl Solution {
    /// Parameters of the smooth surface at a speed.
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
