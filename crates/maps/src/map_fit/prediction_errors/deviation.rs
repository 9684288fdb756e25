//! Deviations of points from a fit, with their standard errors.

use crate::map_fit::fitted_surface::surface::MapFit;
use crate::map_fit::least_squares::observations::Observation;

/// A deviation and its standard error, which combines the errors of the line, of points about a line, and of the point itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deviation {
    pub size: f64,
    pub standard_error: f64,
}

/// Deviations of a point from the line at its speed.
pub(crate) struct Deviations {
    /// In units of the line's scales.
    pub distance: Deviation,
    /// Of efficiency, fraction; `None` if the point has none.
    pub eta: Option<Deviation>,
}

impl MapFit {
    pub(crate) fn deviations(&self, point: &Observation) -> Deviations {
        let [distance_rms, eta_rms] = self.solution.rms;
        let place = self.nearest(
            point.speed_ratio * self.data.nominal_speed_rpm,
            point.flow_kg_s,
            point.pressure_ratio,
            point.flow_scale_kg_s,
            point.ratio_scale,
        );
        Deviations {
            distance: Deviation {
                size: place.distance_ratio,
                standard_error: place.distance_standard_error_ratio.hypot(distance_rms),
            },
            eta: point.eta.map(|eta| Deviation {
                size: (eta - place.eta).abs(),
                standard_error: place.eta_standard_error.hypot(eta_rms).hypot(point.eta_error),
            }),
        }
    }
}
