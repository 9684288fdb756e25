//! Estimates the variance components of a fit by marginal likelihood.
//!
//! The penalty of each parameter over speed, the scatter of the lines and the two residual scales are estimated together
//! with the fit by the update of S. N. Wood and M. Fasiolo ("A generalized Fellner-Schall method for smoothing parameter
//! optimization", Biometrics 73 (2017) 1071-1081). The number of lines thereby determines the
//! detail over speed: parameters that a map does not determine stay straight.

use crate::map_fit::least_squares::problem::{
    Precisions, Problem, ROBUST_SIGMAS, ROUGHNESS_PRECISION_RANGE, Unknowns,
};
use crate::map_fit::speed_lines::line_shape::{PARAMETERS, Parameters};
use nalgebra::DMatrix;

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
    pub(crate) fn deviance(
        &self,
        unknowns: &Unknowns,
        precisions: &Precisions,
        residuals: &[[f64; 2]],
    ) -> f64 {
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
    pub(crate) fn update(
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
