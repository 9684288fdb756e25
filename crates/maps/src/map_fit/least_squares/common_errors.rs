//! Effect of errors common to all points at a place of the fit.
//!
//! A fit follows such an error, so the scatter of the points about the fit does not show it. Its effect at a place is therefore a weighted
//! mean of its effect at the surrounding points.

use mapper_core::{CommonErrors, MapPoint};

/// Distance of half weight, in units of the nominal speed and of the line's maximum flow. Bound: the distance of neighbouring points.
const HALF_WEIGHT_DISTANCE_RATIO: f64 = 0.1;

/// Common errors of the points, with their positions.
#[derive(Debug, Clone, Default)]
pub(crate) struct CommonErrorField {
    points: Vec<Entry>,
}

#[derive(Debug, Clone)]
struct Entry {
    speed_ratio: f64,
    flow_ratio: f64,
    common: CommonErrors,
}

/// Common standard errors at a place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PlaceCommonErrors {
    /// Of efficiency, fraction.
    pub eta_standard_error: f64,
    /// Of corrected flow, ratio.
    pub flow_standard_error_ratio: f64,
    pub pressure_ratio_standard_error: f64,
}

impl CommonErrorField {
    /// Adds a point's errors; `flow_ratio` is its flow over the line's maximum.
    pub(crate) fn add(&mut self, speed_ratio: f64, flow_ratio: f64, point: &MapPoint) {
        let common = point.identified.common.clone();
        if common != CommonErrors::default() {
            self.points.push(Entry { speed_ratio, flow_ratio, common });
        }
    }

    /// Errors at a place: mean over the points with weights that fall with the square of the distance.
    pub(crate) fn at(&self, speed_ratio: f64, flow_ratio: f64) -> PlaceCommonErrors {
        let error_count = self.points.iter().map(|point| point.common.eta_changes.len()).max().unwrap_or(0);
        let mut eta = vec![0.0; error_count];
        let (mut all, mut with_eta) = (0.0, 0.0);
        let mut errors = PlaceCommonErrors::default();
        for Entry { speed_ratio: speed, flow_ratio: flow, common } in &self.points {
            let square = ((speed_ratio - speed).powi(2) + (flow_ratio - flow).powi(2))
                / (HALF_WEIGHT_DISTANCE_RATIO * HALF_WEIGHT_DISTANCE_RATIO);
            let weight = 1.0 / (1.0 + square * square);
            all += weight;
            errors.flow_standard_error_ratio += weight * common.flow_corrected_standard_error_ratio;
            errors.pressure_ratio_standard_error += weight * common.pressure_ratio_standard_error;
            if !common.eta_changes.is_empty() {
                with_eta += weight;
                for (sum, change) in eta.iter_mut().zip(&common.eta_changes) {
                    *sum += weight * change;
                }
            }
        }
        if all > 0.0 {
            errors.flow_standard_error_ratio /= all;
            errors.pressure_ratio_standard_error /= all;
        }
        if with_eta > 0.0 {
            errors.eta_standard_error = eta.iter().map(|sum| (sum / with_eta).powi(2)).sum::<f64>().sqrt();
        }
        errors
    }
}
