//! The fitted surface and its values.

use crate::map_fit::fitted_surface::line_errors::LineErrors;
use crate::map_fit::least_squares::observations::Observations;
use crate::map_fit::least_squares::solution::Solution;
use crate::map_fit::speed_lines::line_shape::LineShape;
use crate::map_fit::speed_lines::nearest::{Scales, nearest};
use std::collections::BTreeMap;

/// Minimum flow of a line as a unit, kg/s. Bound: excludes division by zero.
pub(crate) const MIN_FLOW_KG_S: f64 = 1e-12;
/// Minimum PR - 1 of a line as a unit. Bound: excludes division by zero.
pub(crate) const MIN_RATIO_RANGE: f64 = 1e-6;
/// Relative difference of equal speeds. Bound: rounding.
pub(crate) const SPEED_ROUNDING_RATIO: f64 = 1e-9;

/// Minimum and maximum speed of a fit, over the slowest and the fastest measured speed. Bound: beyond, the errors are larger than the
/// map.
pub(crate) const SPEED_RANGE_RATIO: (f64, f64) = (0.1, 1.3);

/// A fitted surface.
#[derive(Debug, Clone)]
pub struct MapFit {
    pub(crate) data: Observations,
    pub(crate) solution: Solution,
    /// Fits without an outermost line, by that line, as far as they were needed.
    pub(crate) without_line: BTreeMap<usize, MapFit>,
}

/// The place on a fitted line nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestPlace {
    /// Distance in units of the line's scales (flow, pressure ratio minus 1), not negative.
    pub distance_ratio: f64,
    /// Efficiency of the line at the nearest place, fraction.
    pub eta: f64,
    /// One standard error of the line there, across it, in units of the line's scales.
    pub distance_standard_error_ratio: f64,
    /// One standard error of the efficiency without the errors common to all points, fraction.
    pub eta_standard_error: f64,
}

impl MapFit {
    /// Nearest place of the line at `speed_corrected_rpm` to a flow (kg/s) and pressure ratio; distances are measured
    /// in `flow_scale_kg_s` and `ratio_scale`, both above 0.
    pub fn nearest(
        &self,
        speed_corrected_rpm: f64,
        flow_corrected_kg_s: f64,
        pressure_ratio: f64,
        flow_scale_kg_s: f64,
        ratio_scale: f64,
    ) -> NearestPlace {
        let speed_ratio = self.speed_ratio(speed_corrected_rpm);
        let scales = Scales { flow_kg_s: flow_scale_kg_s, ratio: ratio_scale };
        let point = (flow_corrected_kg_s, pressure_ratio);
        let foot = nearest(&self.shape(speed_corrected_rpm), speed_ratio, point, scales, None);
        let (x, y) = (
            (foot.place.flow_kg_s - point.0) / scales.flow_kg_s,
            (foot.place.pressure_ratio - point.1) / scales.ratio,
        );
        let error = LineErrors::new(&self.solution, speed_ratio).at(foot.angle_rad, scales);
        NearestPlace {
            distance_ratio: x.hypot(y),
            eta: self.limit_efficiency(foot.place.eta, self.is_outside(speed_ratio)),
            distance_standard_error_ratio: error.distance_ratio,
            eta_standard_error: error.eta,
        }
    }

    pub(crate) fn speed_ratio(&self, speed_corrected_rpm: f64) -> f64 {
        speed_corrected_rpm / self.data.nominal_speed_rpm
    }

    pub(crate) fn shape(&self, speed_corrected_rpm: f64) -> LineShape {
        self.solution.shape(self.speed_ratio(speed_corrected_rpm))
    }

    /// Whether a speed is outside the measured range.
    pub(crate) fn is_outside(&self, speed_ratio: f64) -> bool {
        self.solution.splines.shape.outside(speed_ratio) > SPEED_ROUNDING_RATIO
    }

    /// The efficiency; in extrapolation at most the best measured one.
    pub(crate) fn limit_efficiency(&self, eta: f64, extrapolated: bool) -> f64 {
        if extrapolated { eta.min(self.solution.best_eta) } else { eta }
    }

    pub(crate) fn speed_bounds_rpm(&self) -> (f64, f64) {
        let (first, last) = (self.data.lines_rpm.first(), self.data.lines_rpm.last());
        (
            SPEED_RANGE_RATIO.0 * first.copied().unwrap_or(1.0),
            SPEED_RANGE_RATIO.1 * last.copied().unwrap_or(1.0),
        )
    }
}
