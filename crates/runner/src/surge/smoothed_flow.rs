//! Smoothed flows of the readings: the flow is a smooth function of the valve opening, which reduces the noise of single means.

use crate::surge::surge_reading::SurgeReading;
use nalgebra::{Matrix3, Vector3};

/// Flows and pressure ratios at one speed, in the order of the readings.
#[derive(Debug, Clone)]
pub(crate) struct SmoothedFlow {
    /// Corrected flow at the speed of the last reading, kg/s.
    pub(crate) flows_kg_s: Vec<f64>,
    /// Relative standard error of the smoothed flow, from the scatter about the curve.
    pub(crate) flow_error_ratio: f64,
}

/// Range of openings above the smallest one that is fitted: beyond it a parabola does not describe a valve.
const REACH_RATIO: f64 = 1.7;

impl SmoothedFlow {
    /// Flows converted to the speed of the last reading by similarity, then smoothed by a parabola of the logarithm of flow over
    /// the logarithm of the opening. With fewer than five readings the flows are as measured.
    pub(crate) fn fit(readings: &[SurgeReading]) -> Option<Self> {
        let last = readings.last()?;
        let to_speed = |reading: &SurgeReading| {
            reading.flow_corrected_kg_s * last.speed_corrected_rpm / reading.speed_corrected_rpm
        };
        let measured: Vec<f64> = readings.iter().map(to_speed).collect();
        let log_distance =
            |reading: &SurgeReading| (reading.valve_opening_ratio / last.valve_opening_ratio).ln();
        let is_near = |reading: &SurgeReading| log_distance(reading).abs() < REACH_RATIO.ln();
        let (mut square, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let mut count = 0usize;
        for (reading, flow) in readings.iter().zip(&measured).filter(|(reading, _)| is_near(reading)) {
            let row = row(log_distance(reading));
            square += row * row.transpose();
            right += row * flow.ln();
            count += 1;
        }
        let unsmoothed = SmoothedFlow { flows_kg_s: measured.clone(), flow_error_ratio: 0.0 };
        let (true, Some(inverse)) = (count >= 5, square.try_inverse()) else { return Some(unsmoothed) };
        let parabola = inverse * right;
        let flow = |reading: &SurgeReading| row(log_distance(reading)).dot(&parabola);
        let pairs = || readings.iter().zip(&measured).filter(|(reading, _)| is_near(reading));
        let residual: f64 = pairs().map(|(reading, measured)| (measured.ln() - flow(reading)).powi(2)).sum();
        let sigma_ratio = (residual / (count - 3).max(1) as f64).sqrt();
        let at_last = row(0.0);
        let flows_kg_s = readings
            .iter()
            .zip(&measured)
            .map(|(reading, measured)| if is_near(reading) { flow(reading).exp() } else { *measured })
            .collect();
        let flow_error_ratio = sigma_ratio * at_last.dot(&(inverse * at_last)).max(0.0).sqrt();
        Some(SmoothedFlow { flows_kg_s, flow_error_ratio })
    }
}

fn row(log_distance: f64) -> Vector3<f64> {
    Vector3::new(1.0, log_distance, log_distance * log_distance)
}
