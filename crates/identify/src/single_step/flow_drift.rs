//! The error of a constant h if h changes within the window, mainly with the flow and with the viscosity at the wall.

use crate::single_step::fit::Fit;
use crate::step_data::samples::{Row, Samples};
use mapper_numerics::statistics::mean;
use mapper_physics::laws::compression::compressed_k;
use mapper_physics::laws::convection::coefficient_w_m2k;
use mapper_physics::machine::params::{CompressorParams, Params};

/// Changes of flow and h, and their effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FlowDrift {
    /// Ratio of the flow at the window's end to that at its start, minus 1.
    pub(crate) flow_ratio: f64,
    /// Estimated error of the fitted eta, fraction.
    pub(crate) eta: f64,
    /// Estimated error of the fitted h relative to h at the window's end, W/(m2 K).
    pub(crate) h_w_m2k: f64,
}

/// Estimates the error of a fit with constant h if h follows the correlation of Appendix A: the fit's response to the T2 change from
/// the variable h. Only the change of h matters, not the level of the correlation.
pub(crate) fn flow_drift(fit: &Fit, samples: &Samples, end_s: f64) -> Option<FlowDrift> {
    let rows = &samples.rows;
    let last_s = rows.last()?.t_s;
    let late = rows.partition_point(|row| row.t_s < last_s - end_s);
    let flow_end_kg_s = mean(rows[late..].iter().map(|row| row.flow_kg_s))?;
    let flow_change_kg_s = samples.change(|row| row.flow_kg_s, end_s)?;
    let compressor = Params::default().compressor;
    let relative: Vec<f64> = rows.iter().map(|row| relative_h(fit, row, &compressor)).collect();
    let end = mean(&relative[late..])?;
    let departure = relative.iter().map(|h| h / end - 1.0);
    let gas_k = departure.zip(&fit.gas_by_h).map(|(ratio, by_h)| by_h * fit.h_w_m2k * ratio).collect();
    let response = fit.response(&fit.read(gas_k));
    let drift = FlowDrift {
        flow_ratio: flow_change_kg_s / (flow_end_kg_s - flow_change_kg_s),
        eta: response[0],
        h_w_m2k: response[1],
    };
    (drift.flow_ratio.is_finite() && drift.eta.is_finite() && drift.h_w_m2k.is_finite()).then_some(drift)
}

/// The correlation's h of a sample: gas properties at the temperature after adiabatic compression, wall viscosity at the housing temperature.
fn relative_h(fit: &Fit, row: &Row, compressor: &CompressorParams) -> f64 {
    let bulk_k = compressed_k(row.t1_k, row.rise_ratio, fit.eta, compressor.air());
    coefficient_w_m2k(
        compressor.nusselt_coefficient,
        compressor.nusselt_exponent,
        compressor.outlet_diameter_m,
        row.flow_kg_s,
        bulk_k,
        row.tc_k,
    )
}
