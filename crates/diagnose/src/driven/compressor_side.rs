//! Compressor side driven by its measured neighbours: eqs. 1-3, one housing node, and the probe.

use crate::driven::Rows;
use crate::driven::parameters::Values;
use mapper_numerics::statistics::mean;
use mapper_physics::laws::compression::{CompressionInputs, compress, compressed_k, isentropic_rise_ratio};
use mapper_physics::laws::housing::compressor_capacity_j_k;
use mapper_physics::laws::{nusselt, thermocouple};
use mapper_physics::machine::params::Params;

/// Limits of the efficiency polynomial: outside them it does not describe a working compressor.
pub(crate) const EFFICIENCY: (f64, f64) = (0.25, 0.90);

/// Declared machine, and the middle of the log as reference of its efficiency.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Declared {
    /// Geometry, masses and correlations.
    pub params: Params,
    /// Speed at which the relative speed is 0, rpm.
    middle_speed_rpm: f64,
    /// Flow coefficient m T1/(P1 N) at which its logarithm is 0, kg K/(s Pa rpm).
    middle_flow: f64,
}

impl Declared {
    /// With the geometric means of the rows as the reference of the efficiency.
    pub fn new(params: &Params, rows: &Rows) -> Self {
        let (middle_speed_rpm, middle_flow) = middles(rows);
        Declared { params: *params, middle_speed_rpm, middle_flow }
    }
}

/// Geometric means of speed and flow coefficient over the rows; 1 without any.
pub(crate) fn middles(rows: &Rows) -> (f64, f64) {
    let [speed_rpm, flow_kg_s, p1_pa, _, t1_k] = rows.drives();
    let flow = |i: usize| flow_coefficient(speed_rpm[i], flow_kg_s[i], p1_pa[i], t1_k[i]).ln();
    let geometric = |mean: Option<f64>| mean.map_or(1.0, f64::exp);
    (geometric(mean(speed_rpm.iter().map(|rpm| rpm.ln()))), geometric(mean((0..rows.len()).map(flow))))
}

/// Flow over speed at inlet density: the flow coefficient without wheel size and gas constant.
pub(crate) fn flow_coefficient(speed_rpm: f64, flow_kg_s: f64, p1_pa: f64, t1_k: f64) -> f64 {
    flow_kg_s * t1_k / (p1_pa * speed_rpm)
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Predicted {
    /// T2 as measured by the probe, K.
    pub t2_k: Vec<f64>,
    /// Housing, K.
    pub tc_k: Vec<f64>,
    /// Isentropic efficiency, fraction.
    pub efficiency: Vec<f64>,
}

/// Simulates the first `count` rows.
pub(crate) fn predict(rows: &Rows, declared: &Declared, values: &Values, count: usize) -> Predicted {
    let [
        eta,
        eta_speed,
        eta_speed_2,
        eta_flow,
        eta_flow_2,
        h_ratio,
        alpha_area_ratio,
        capacity_ratio,
        loss_w_k,
        surroundings_k,
        start_over_k,
        probe_mm,
        t2_offset_k,
        _,
    ] = values.0;
    let compressor = &declared.params.compressor;
    let air = compressor.air();
    let count = count.min(rows.len());
    let [speed_rpm, flows_kg_s, p1_pa, p2_pa, t1s_k] = rows.drives();
    let t2_k = &rows.judged[0].1;
    let mut predicted = Predicted::default();
    let mut state: Option<(f64, f64)> = None;
    for i in 0..count {
        let (t1_k, flow_kg_s) = (t1s_k[i], flows_kg_s[i]);
        let speed = (speed_rpm[i] / declared.middle_speed_rpm).ln();
        let flow = (flow_coefficient(speed_rpm[i], flow_kg_s, p1_pa[i], t1_k) / declared.middle_flow).ln();
        let efficiency =
            (eta + (eta_speed + eta_speed_2 * speed) * speed + (eta_flow + eta_flow_2 * flow) * flow)
                .clamp(EFFICIENCY.0, EFFICIENCY.1);
        let (mut tc_k, mut reading_k) =
            state.unwrap_or((0.5 * (t1_k + t2_k[i]) + start_over_k, t2_k[i] - t2_offset_k));
        let air = air.between(p1_pa[i], p2_pa[i]);
        let rise = isentropic_rise_ratio(p2_pa[i] / p1_pa[i], t1_k, air);
        let h_w_m2k = h_ratio
            * nusselt::coefficient_w_m2k(
                compressor.nusselt_coefficient,
                compressor.nusselt_exponent,
                compressor.outlet_diameter_m,
                flow_kg_s,
                compressed_k(t1_k, rise, efficiency, air),
                tc_k,
            );
        let gas = compress(
            &CompressionInputs {
                air,
                t1_k,
                tc_k,
                flow_kg_s,
                isentropic_rise_ratio: rise,
                efficiency,
                h_w_m2k,
                inlet_h_ratio: compressor.inlet_h_ratio,
                alpha_area_ratio: alpha_area_ratio.clamp(0.0, 1.0),
                internal_area_m2: compressor.internal_area_m2,
            },
            None,
        );
        let elapsed_s = rows.elapsed_s(i);
        let lag_s =
            thermocouple::time_constant_s(1e-3 * probe_mm, compressor.outlet_diameter_m, flow_kg_s, gas.t2_k);
        predicted.t2_k.push(reading_k + t2_offset_k);
        predicted.tc_k.push(tc_k);
        predicted.efficiency.push(efficiency);
        let keep = if lag_s > 0.0 { (-elapsed_s / lag_s).exp() } else { 0.0 };
        reading_k = gas.t2_k + (reading_k - gas.t2_k) * keep;
        let capacity_j_k = capacity_ratio * compressor_capacity_j_k(&declared.params, tc_k);
        // Exact for constant gas and surroundings, and bounded over a gap in the log.
        let conductance_w_k = h_w_m2k * compressor.internal_area_m2 + loss_w_k;
        let net_w = gas.q1_w + gas.q2_w - loss_w_k * (tc_k - surroundings_k);
        tc_k += net_w / conductance_w_k * (1.0 - (-conductance_w_k * elapsed_s / capacity_j_k).exp());
        state = Some((tc_k, reading_k));
    }
    predicted
}
