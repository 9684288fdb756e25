//! Splines over speed that all parameters share, with their weights at a speed.

use crate::map_fit::speed_lines::line_shape::{PARAMETERS, Parameters, WORK};
use crate::map_fit::speed_lines::speed_spline::{Coordinate, SpeedSpline};
use nalgebra::{DMatrix, DVector};

/// Splines over speed with equal knots.
#[derive(Debug, Clone)]
pub(crate) struct Splines {
    pub shape: SpeedSpline,
    pub work: SpeedSpline,
    speed_ratios: Vec<f64>,
}

impl Splines {
    pub(crate) fn new(speed_ratios: &[f64]) -> Self {
        Splines {
            shape: SpeedSpline::new(Coordinate::Speed, speed_ratios),
            work: SpeedSpline::new(Coordinate::InverseSpeed, speed_ratios),
            speed_ratios: speed_ratios.to_vec(),
        }
    }

    pub(crate) fn of(&self, parameter: usize) -> &SpeedSpline {
        if parameter < WORK { &self.shape } else { &self.work }
    }

    pub(crate) fn rows(&self, speed_ratio: f64) -> Rows {
        Rows { shape: self.shape.row(speed_ratio), work: self.work.row(speed_ratio) }
    }

    /// Knot values, one row per parameter, of parameters given as a function of speed.
    pub(crate) fn values(&self, at: impl Fn(f64) -> Parameters) -> DMatrix<f64> {
        let mut values = DMatrix::zeros(PARAMETERS, self.len());
        for (k, speed_ratio) in self.speed_ratios.iter().enumerate() {
            values.set_column(k, &DVector::from_row_slice(&at(*speed_ratio)));
        }
        values
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
