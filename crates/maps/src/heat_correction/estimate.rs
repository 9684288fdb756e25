//! Estimates the heat with which the work coefficients of all speed lines fall on one curve.

use super::error::HeatCorrectionError;
use super::work::WorkPoint;
use mapper_numerics::statistics::mean;
use nalgebra::{DMatrix, DVector};

/// Median absolute value of a standard normal distribution. Source: its quantile at 0.75.
const MEDIAN_OF_SIZE: f64 = 0.6745;
/// Minimum scatter, ratio. Bound: exact points keep weights.
const MIN_SCATTER: f64 = 1e-9;

/// Robust standard deviations beyond which a residual loses weight (Huber). Source: Huber, Robust Statistics (1981).
const HUBER_THRESHOLD: f64 = 1.5;
/// Rounds of reweighting. Bound: weights converge in a few.
const ROUNDS: usize = 8;
/// Minimum number of points. Bound: four parameters.
const MIN_POINTS: usize = 8;
/// Minimum number of lines. Bound: a trend over speed needs three.
const MIN_LINES: usize = 3;
/// Minimum ratio of the line speeds. Bound: heat falls with the cube of speed, by three over it.
const MIN_SPEED_RATIO: f64 = 1.5;
/// Minimum ratio of smallest to largest singular value of a determined fit. Bound: its square is above rounding of f64.
const MIN_SINGULAR_VALUE_RATIO: f64 = 1e-5;

/// The heat of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeatEstimate {
    /// Heat to the gas at the reference state, W; negative if slow lines take less work than fast ones.
    pub heat_w: f64,
    /// Its standard error by leaving each line out in turn, W.
    pub standard_error_w: f64,
    /// Robust scatter of the work coefficients about the curve, ratio.
    pub scatter_ratio: f64,
}

/// Estimates the heat of a map from its work coefficients.
pub fn estimate_heat(points: &[WorkPoint]) -> Result<HeatEstimate, HeatCorrectionError> {
    let mut lines: Vec<usize> = points.iter().map(|point| point.line).collect();
    lines.dedup();
    if points.len() < MIN_POINTS || lines.len() < MIN_LINES {
        return Err(HeatCorrectionError::TooFew { points: points.len(), lines: lines.len() });
    }
    let speeds = || points.iter().map(|point| point.speed_ratio);
    let ratio = speeds().fold(0.0, f64::max) / speeds().fold(f64::INFINITY, f64::min);
    if ratio < MIN_SPEED_RATIO {
        return Err(HeatCorrectionError::OneSpeed { ratio });
    }
    let (heat_w, scatter_ratio) = fit_heat(points).ok_or(HeatCorrectionError::Singular)?;
    // Points of a line share errors (speed, day), so whole lines are left out.
    let without = |line: &usize| {
        let others: Vec<WorkPoint> = points.iter().filter(|point| point.line != *line).copied().collect();
        fit_heat(&others).map(|(heat_w, _)| heat_w)
    };
    let left_out: Vec<f64> = lines.iter().filter_map(without).collect();
    if left_out.len() < MIN_LINES {
        return Err(HeatCorrectionError::Singular);
    }
    let count = left_out.len() as f64;
    let mean_w = mean(&left_out).ok_or(HeatCorrectionError::Singular)?;
    let spread = left_out.iter().map(|heat_w| (heat_w - mean_w).powi(2)).sum::<f64>();
    Ok(HeatEstimate { heat_w, standard_error_w: ((count - 1.0) / count * spread).sqrt(), scatter_ratio })
}

/// Fits the heat, W, and the scatter about the curve, ratio.
fn fit_heat(points: &[WorkPoint]) -> Option<(f64, f64)> {
    // Relative residuals: every row over its own work coefficient.
    let mut rows = DMatrix::from_fn(points.len(), 4, |row, column| {
        let point = &points[row];
        let value = match column {
            0 => 1.0,
            1 => point.exit_flow,
            2 => 1.0 / point.inlet_flow,
            _ => point.work_coefficient_per_watt(),
        };
        value / point.work_coefficient
    });
    // Columns are scaled to equal size, so that the rank does not depend on units.
    let sizes: Vec<f64> = (0..4).map(|column| rows.column(column).norm()).collect();
    for (column, size) in sizes.iter().enumerate() {
        if *size <= 0.0 || !size.is_finite() {
            return None;
        }
        rows.column_mut(column).scale_mut(1.0 / size);
    }
    let mut weights = vec![1.0; points.len()];
    let mut estimate = None;
    for _ in 0..ROUNDS {
        let root = |row: usize| f64::sqrt(weights[row]);
        let weighted = DMatrix::from_fn(points.len(), 4, |row, column| root(row) * rows[(row, column)]);
        let right = DVector::from_fn(points.len(), |row, _| root(row));
        let svd = weighted.svd(true, true);
        if svd.singular_values.min() < MIN_SINGULAR_VALUE_RATIO * svd.singular_values.max() {
            return None;
        }
        let solution = svd.solve(&right, 0.0).ok()?;
        let residuals = &rows * &solution - DVector::from_element(points.len(), 1.0);
        let mut sorted: Vec<f64> = residuals.iter().map(|residual| residual.abs()).collect();
        sorted.sort_by(f64::total_cmp);
        let scatter = (sorted.get(sorted.len() / 2)? / MEDIAN_OF_SIZE).max(MIN_SCATTER);
        for (weight, residual) in weights.iter_mut().zip(residuals.iter()) {
            *weight = (HUBER_THRESHOLD * scatter / residual.abs().max(f64::MIN_POSITIVE)).min(1.0);
        }
        estimate = Some((solution[3] / sizes[3], scatter));
    }
    estimate.filter(|(heat_w, _)| heat_w.is_finite())
}
