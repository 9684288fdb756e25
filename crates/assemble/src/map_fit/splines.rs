//! The splines over speed that all parameters share, and their weights at a speed.

use super::line_shape::WORK;
use super::speed_spline::{Coordinate, SpeedSpline};
use nalgebra::DVector;

/// Splines over speed with equal knots.
#[derive(Debug, Clone)]
pub(crate) struct Splines {
    /// Of the line's shape.
    pub shape: SpeedSpline,
    /// Of the work coefficient.
    pub work: SpeedSpline,
}

impl Splines {
    pub(crate) fn new(speed_ratios: &[f64]) -> Self {
        Splines {
            shape: SpeedSpline::new(Coordinate::Speed, speed_ratios),
            work: SpeedSpline::new(Coordinate::Slowness, speed_ratios),
        }
    }

    pub(crate) fn of(&self, parameter: usize) -> &SpeedSpline {
        if parameter < WORK { &self.shape } else { &self.work }
    }

    pub(crate) fn rows(&self, speed_ratio: f64) -> Rows {
        Rows { shape: self.shape.row(speed_ratio), work: self.work.row(speed_ratio) }
    }

    pub(crate) fn len(&self) -> usize {
        self.shape.len()
    }
}

/// Weights of the knot values at a speed.
pub(crate) struct Rows {
    pub shape: DVector<f64>,
    pub work: DVector<f64>,
}

impl Rows {
    pub(crate) fn of(&self, parameter: usize) -> &DVector<f64> {
        if parameter < WORK { &self.shape } else { &self.work }
    }
}
