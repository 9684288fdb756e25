//! Standard errors of the places of a line.

use crate::map_fit::least_squares::problem::PARAMETER_STEP;
use crate::map_fit::least_squares::solution::Solution;
use crate::map_fit::speed_lines::line_shape::{FlowFrame, LineShape, PARAMETERS, Parameters, WORK};
use crate::map_fit::speed_lines::nearest::{DIFFERENCE_STEP_RAD, MIN_SQUARE_SLOPE};
use crate::map_fit::speed_lines::nearest::{Scales, normal};
use nalgebra::{DMatrix, DVector};

/// One standard error of a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaceError {
    /// Across the line, in units of the line's scales.
    pub distance_ratio: f64,
    /// The part of it along the axis of flow, not negative.
    pub flow_part_ratio: f64,
    /// The part of it along the axis of pressure ratio, not negative.
    pub pressure_part_ratio: f64,
    /// Of efficiency at the nearest place, fraction.
    pub eta: f64,
}

/// A line with the covariance of its parameters.
pub(crate) struct LineErrors {
    frame: FlowFrame,
    parameters: Parameters,
    covariance: DMatrix<f64>,
    speed_ratio: f64,
}

impl LineErrors {
    pub(crate) fn new(solution: &Solution, speed_ratio: f64) -> Self {
        LineErrors {
            frame: solution.frame,
            parameters: solution.parameters(speed_ratio),
            covariance: solution.covariance(speed_ratio),
            speed_ratio,
        }
    }

    /// Errors at an angle of the line, rad.
    pub(crate) fn at(&self, angle_rad: f64, scales: Scales) -> PlaceError {
        let at = |shape: &LineShape, angle: f64| {
            let place = shape.physical(angle, self.speed_ratio);
            [place.flow_kg_s / scales.flow_kg_s, place.pressure_ratio / scales.ratio, place.eta]
        };
        let shape = LineShape::new(&self.parameters, self.frame);
        let (here, next) = (at(&shape, angle_rad), at(&shape, angle_rad + DIFFERENCE_STEP_RAD));
        let slope: [f64; 3] = std::array::from_fn(|i| (next[i] - here[i]) / DIFFERENCE_STEP_RAD);
        let (nx, ny) = normal(&slope);
        let length = (slope[0].powi(2) + slope[1].powi(2)).max(MIN_SQUARE_SLOPE);
        let place = shape.at(angle_rad);
        let work_terms = shape.work_terms(place.flow_at_nominal_kg_s, place.head);
        let (mut across, mut eta) = (DVector::zeros(PARAMETERS), DVector::zeros(PARAMETERS));
        for q in 0..PARAMETERS {
            if q >= WORK {
                // The work parameters affect efficiency only.
                eta[q] = -here[2] * work_terms[q - WORK];
                continue;
            }
            let mut moved = self.parameters;
            moved[q] += PARAMETER_STEP;
            let there = at(&LineShape::new(&moved, self.frame), angle_rad);
            let d: [f64; 3] = std::array::from_fn(|i| (there[i] - here[i]) / PARAMETER_STEP);
            across[q] = d[0] * nx + d[1] * ny;
            // The nearest place moves along the line as the line moves.
            eta[q] = d[2] - slope[2] * (d[0] * slope[0] + d[1] * slope[1]) / length;
        }
        let error = |gradient: &DVector<f64>| gradient.dot(&(&self.covariance * gradient)).max(0.0).sqrt();
        let distance = error(&across);
        PlaceError {
            distance_ratio: distance,
            flow_part_ratio: distance * nx.abs(),
            pressure_part_ratio: distance * ny.abs(),
            eta: error(&eta),
        }
    }
}
