//! Humidity from a hygrometer or a dew-point mirror.

use crate::config::IdentifyConfig;
use mapper_core::{Channel, Recording, check_running};
use mapper_numerics::SLOPE_STEP;
use mapper_numerics::statistics::mean;
use mapper_physics::gas::air::humidity_kg_kg;

/// The configuration with the humidity that was measured, the mean over the recording. A hygrometer is assumed to be in the air of the cell, or of the
/// inlet if the cell's temperature was not recorded. Without a plausible reading the declared humidity stays.
pub fn with_measured_humidity(recording: &Recording, config: &IdentifyConfig) -> IdentifyConfig {
    let mut config = config.clone();
    let reading = |channel: Channel| {
        let values = &recording.series.get(&channel)?.values;
        let running: Vec<f64> =
            values.iter().copied().filter(|value| check_running(channel, *value).is_ok()).collect();
        let declared = config.sensor(channel);
        let value = mean(running.iter().copied())?;
        let noise = declared.noise_sigma / (running.len() as f64).sqrt();
        Some((value, noise.hypot(declared.offset_sigma).hypot(declared.gain_sigma_ratio * value)))
    };
    let inlet_k = reading(Channel::T1).map(|(value, _)| value);
    let cell_k = reading(Channel::TAmb).map(|(value, _)| value).or(inlet_k);
    let (Some(cell_k), Some((p1_pa, _))) = (cell_k, reading(Channel::P1)) else { return config };
    let at_dew_point = |temperature_k: f64| humidity_kg_kg(1.0, temperature_k, p1_pa);
    let at_relative = |ratio: f64| humidity_kg_kg(ratio, cell_k, p1_pa);
    let measured = |(value, sigma): (f64, f64), humidity: &dyn Fn(f64) -> f64| {
        let by = SLOPE_STEP * value;
        (humidity(value), ((humidity(value + by) - humidity(value - by)) / (2.0 * by)).abs() * sigma)
    };
    // A mirror is the more accurate of the two.
    let dew_point = reading(Channel::DewPoint).map(|reading| measured(reading, &at_dew_point));
    let relative = || {
        let reading = reading(Channel::RelativeHumidity).filter(|(value, _)| *value > 0.0)?;
        Some(measured(reading, &at_relative))
    };
    if let Some((humidity_kg_kg, sigma_kg_kg)) = dew_point.or_else(relative) {
        config.air = config.air.with_humidity(humidity_kg_kg);
        config.humidity_sigma_kg_kg = sigma_kg_kg;
    }
    config
}
