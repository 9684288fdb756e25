//! Predicts the result of a single-step method for a forecast step, for planning before the measurement. For `joint` see `joint/expected.rs`.

use crate::IdentifyConfig;
use crate::single_step::bias::declared_effect;
use crate::single_step::covariance::{Correlation, NoiseVariances};
use crate::single_step::fit::{Geometry, fit};
use crate::single_step::steady::{Means, uncertainty};
use crate::step_data::samples::Samples;
use mapper_physics::laws::compression::isentropic_rise_ratio;

/// Sample interval to which the declared noise of a campaign refers, s.
pub const DECLARED_INTERVAL_S: f64 = 0.1;

/// One instant of a forecast, total values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpectedRow {
    /// Time, s, rising.
    pub t_s: f64,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Inlet temperature, K.
    pub t1_k: f64,
    /// Reading of the outlet probe, K.
    pub t2_k: f64,
    /// Housing temperature, K.
    pub tc_k: f64,
    /// Inlet pressure, Pa.
    pub p1_pa: f64,
    /// Outlet pressure, Pa.
    pub p2_pa: f64,
    /// Flow, kg/s.
    pub flow_kg_s: f64,
}

/// Expected result of the dynamic method for a forecast window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Expected efficiency without noise, fraction.
    pub eta: f64,
    /// Its standard error from declared noise, fixed offsets and gains, fraction.
    pub sigma_eta: f64,
    /// Expected heat-transfer coefficient without noise, W/(m2 K).
    pub h_w_m2k: f64,
    /// Its standard error, W/(m2 K).
    pub sigma_h_w_m2k: f64,
}

/// Fits noise-free rows like a recording, and propagates the declared uncertainties.
///
/// `interval_s` is that of the rows. Rows sparser than a recording's 10 Hz represent means of its samples: the white part of the noise
/// averages out, the first-order part does not. `None` if the fit does not converge.
pub fn expected(rows: &[ExpectedRow], interval_s: f64, config: &IdentifyConfig) -> Option<Expected> {
    let column = |value: fn(&ExpectedRow) -> f64| rows.iter().map(value).collect::<Vec<f64>>();
    let samples = Samples {
        t_s: column(|row| row.t_s),
        t1_k: column(|row| row.t1_k),
        t2_k: column(|row| row.t2_k),
        tc_k: column(|row| row.tc_k),
        p1_pa: column(|row| row.p1_pa),
        p2_pa: column(|row| row.p2_pa),
        flow_kg_s: column(|row| row.flow_kg_s),
        rise_ratio: rows
            .iter()
            .map(|row| {
                let air = config.air.between(row.p1_pa, row.p2_pa);
                isentropic_rise_ratio(row.p2_pa / row.p1_pa, row.t1_k, air)
            })
            .collect(),
        lost: 0,
    };
    let geometry = Geometry::of(config);
    let fit = fit(&samples, geometry)?;
    let declared = declared_effect(&fit, &samples, geometry, config);
    let mut noise = NoiseVariances::split(declared.noise_k2, config.noise_colour);
    noise.white_k2 *= (DECLARED_INTERVAL_S / interval_s).min(1.0);
    let [eta, h] = Correlation::of(&fit, &samples.t_s, config.noise_colour).standard_errors_for(noise);
    let [offset_eta, offset_h] = declared.bias_standard_errors;
    let sigma_eta = eta.hypot(offset_eta);
    let found = Expected { eta: fit.eta, sigma_eta, h_w_m2k: fit.h_w_m2k, sigma_h_w_m2k: h.hypot(offset_h) };
    (found.eta.is_finite() && found.sigma_eta.is_finite() && found.sigma_h_w_m2k.is_finite()).then_some(found)
}

/// Apparent efficiency of a settled point (conventional mapping), and its standard error from declared offsets and gains, fractions. `None` if
/// the temperature rise gives no efficiency.
pub fn expected_steady(row: &ExpectedRow, config: &IdentifyConfig) -> Option<(f64, f64)> {
    let means = Means { t1_k: row.t1_k, t2_k: row.t2_k, p1_pa: row.p1_pa, p2_pa: row.p2_pa, air: config.air };
    let eta = means.apparent_eta();
    let sigma = uncertainty(&means, &Samples::default(), config).0.bias_standard_error;
    (eta.is_finite() && eta > 0.0 && sigma.is_finite()).then_some((eta, sigma))
}
