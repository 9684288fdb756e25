//! Predicted and measured T2 of a step, so that a user can check a point.

use crate::IdentifyConfig;
use crate::single_step::fit::{Geometry, t2_k};
use crate::single_step::probe::ProbeResponse;
use crate::step_data::samples::Samples;
use mapper_core::{IdentifiedPoint, Recording};
use mapper_numerics::statistics::mean;

/// T2 over the window of a step.
#[derive(Debug, Clone, PartialEq)]
pub struct T2History {
    /// Index of the step.
    pub step: usize,
    /// Times of the rows, run time, s.
    pub t_s: Vec<f64>,
    /// Measured T2, K.
    pub read_k: Vec<f64>,
    /// T2 by eqs. 1-3 from the readings of T1, Tc, flow and pressures with the point's constant efficiency and h, through the declared probe,
    /// K. Its mean equals that of the readings.
    pub model_k: Vec<f64>,
    /// Constant added to the model for equal means, K: offsets found by `joint`, and changes within the step.
    pub shift_k: f64,
}

/// T2 over the window of a point; `None` without an efficiency, h, window or readings.
///
/// `joint` lets efficiency and h change along the map within a step. Here they are constant, as in the table of points, so the difference
/// shows the effect of that change.
pub fn t2_history(
    recording: &Recording,
    point: &IdentifiedPoint,
    config: &IdentifyConfig,
) -> Option<T2History> {
    let (eta, h_w_m2k, window) = (point.eta?, point.h_w_m2k?, point.window?);
    let samples = Samples::of(recording, window, config, true);
    let geometry = Geometry::of(config);
    let read: Vec<f64> = samples.rows.iter().map(|row| row.t2_k).collect();
    let gas_k: Vec<f64> = samples.rows.iter().map(|row| t2_k(geometry, row, eta, h_w_m2k)).collect();
    let model_k = match ProbeResponse::of(&samples, geometry.probe) {
        None => gas_k,
        Some(response) => {
            // The probe's first reading is unknown: the part of the difference that it explains belongs to the model.
            let read_k = response.read(&gas_k);
            let mut left: Vec<f64> = read.iter().zip(&read_k).map(|(read, model)| read - model).collect();
            response.without_first_reading(&mut left);
            read.iter().zip(&left).map(|(read, left)| read - left).collect()
        }
    };
    let shift_k = mean(read.iter().zip(&model_k).map(|(read, model)| read - model))?;
    let model_k = model_k.into_iter().map(|model| model + shift_k).collect();
    Some(T2History { step: point.step, t_s: samples.times_s(), read_k: read, model_k, shift_k })
}
