//! What the errors that all points share do at a place of the fit.
//!
//! Such an error is as smooth over the map as its cause, and a fit through points follows it: the scatter of the points
//! about the fit says nothing of it. So it is carried to a place from the points around.

use mapper_core::{CommonErrors, MapPoint};

/// Distance at which a point has half the weight of one at the place, in units of speed and of the line's largest flow.
const REACH: f64 = 0.1;

/// Common errors of the points, and where these lie.
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
pub(crate) struct CommonAt {
    /// Of efficiency, fraction.
    pub eta_standard_error: f64,
    /// Of corrected flow, ratio.
    pub flow_standard_error_ratio: f64,
    /// Of the pressure ratio.
    pub pressure_ratio_standard_error: f64,
}

impl CommonErrorField {
    /// Takes a point's errors in; `flow_ratio`: its flow over the line's largest.
    pub(crate) fn add(&mut self, speed_ratio: f64, flow_ratio: f64, point: &MapPoint) {
        let common = point.identified.common.clone();
        if common != CommonErrors::default() {
            self.points.push(Entry { speed_ratio, flow_ratio, common });
        }
    }

    /// Errors at a place, by the points around with weights that fall with the square of the distance.
    pub(crate) fn at(&self, speed_ratio: f64, flow_ratio: f64) -> CommonAt {
        let most = self.points.iter().map(|point| point.common.eta_changes.len()).max().unwrap_or(0);
        let mut eta = vec![0.0; most];
        let (mut all, mut with_eta) = (0.0, 0.0);
        let mut found = CommonAt::default();
        for Entry { speed_ratio: speed, flow_ratio: flow, common } in &self.points {
            let square = ((speed_ratio - speed).powi(2) + (flow_ratio - flow).powi(2)) / (REACH * REACH);
            let weight = 1.0 / (1.0 + square * square);
            all += weight;
            found.flow_standard_error_ratio += weight * common.flow_corrected_standard_error_ratio;
            found.pressure_ratio_standard_error += weight * common.pressure_ratio_standard_error;
            if !common.eta_changes.is_empty() {
                with_eta += weight;
                for (sum, change) in eta.iter_mut().zip(&common.eta_changes) {
                    *sum += weight * change;
                }
            }
        }
        if all > 0.0 {
            found.flow_standard_error_ratio /= all;
            found.pressure_ratio_standard_error /= all;
        }
        if with_eta > 0.0 {
            found.eta_standard_error = eta.iter().map(|sum| (sum / with_eta).powi(2)).sum::<f64>().sqrt();
        }
        found
    }
}
