//! Predicts the result of a single-step method for a forecast step, for planning before the measurement. For `joint` see `joint/expected.rs`.

use crate::IdentifyConfig;
use crate::single_step::covariance::{Correlation, NoiseVariances, declared_effect};
use crate::single_step::fit::{Geometry, fit};
use crate::single_step::steady::{apparent_eta, uncertainty};
use crate::step_data::samples::{Samples, forecast_row};
use mapper_core::{MethodResult, SAMPLE_INTERVAL_S};
use mapper_physics::operating_point::forecast::ForecastRow;

/// Fits noise-free rows like a recording, and propagates the declared uncertainties.
///
/// `interval_s` is that of the rows. Rows sparser than a recording's 10 Hz represent means of its samples: the white part of the noise
/// averages out, the first-order part does not. `None` if the fit does not converge.
pub fn expected(rows: &[ForecastRow], interval_s: f64, config: &IdentifyConfig) -> Option<MethodResult> {
    let rows = rows.iter().map(|row| forecast_row(row, config.air)).collect();
    let samples = Samples { rows, lost: 0 };
    let geometry = Geometry::of(config);
    let fit = fit(&samples, geometry)?;
    let declared = declared_effect(&fit, &samples, geometry, config);
    let mut noise = NoiseVariances::split(declared.noise_k2, config.noise());
    noise.white_k2 *= (SAMPLE_INTERVAL_S / interval_s).min(1.0);
    let [eta, h] = Correlation::of(&fit, &samples.times_s(), config.noise_colour).standard_errors_for(noise);
    let [offset_eta, offset_h] = declared.bias_standard_errors;
    let sigma_eta = eta.hypot(offset_eta);
    let found =
        MethodResult { eta: fit.eta, sigma_eta, h_w_m2k: fit.h_w_m2k, sigma_h_w_m2k: h.hypot(offset_h) };
    (found.eta.is_finite() && found.sigma_eta.is_finite() && found.sigma_h_w_m2k.is_finite()).then_some(found)
}

/// Apparent efficiency of a settled point (conventional mapping), and its standard error from declared offsets and gains, fractions. `None` if
/// the temperature rise gives no efficiency.
pub fn expected_steady(row: &ForecastRow, config: &IdentifyConfig) -> Option<(f64, f64)> {
    let row = forecast_row(row, config.air);
    let eta = apparent_eta(&row, config.air);
    let sigma = uncertainty(&row, &Samples::default(), config).0.bias_standard_error;
    (eta.is_finite() && eta > 0.0 && sigma.is_finite()).then_some((eta, sigma))
}
