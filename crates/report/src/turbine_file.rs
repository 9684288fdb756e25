//! Turbine results from a compressor test: flow parameter, and efficiency with mechanical loss.
//!
//! Limits: one row a step, at its end. Efficiency is the compressor's power over the turbine's isentropic power, total to
//! static. It includes the bearing loss, and the heat that the gas loses to the turbine housing before the wheel counts as loss. A
//! housing that still warms up lowers it. Shaft acceleration is not corrected for: the speed has settled. Expansion is from
//! the total inlet pressure to the outlet pressure as tapped.

use mapper_core::{Channel, IdentifiedPoint, Recording, one_line};
use mapper_observe::energy_balance::Gases;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::{compressed_k, isentropic_rise_ratio};
use serde::Serialize;
use std::fmt::Write;

/// Time before a step's end over which the turbine's channels are averaged, s.
const AVERAGE_S: f64 = 10.0;

/// The turbine at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TurbinePoint {
    /// Index of the step, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    pub step: usize,
    /// Speed over the root of the inlet temperature, rpm/K^0.5.
    pub speed_parameter_rpm_sqrt_k: f64,
    /// Flow parameter `m sqrt(T3)/P3`, kg K^0.5/(s kPa).
    pub flow_parameter_kg_sqrt_k_s_kpa: f64,
    /// Expansion ratio P3/P4.
    pub expansion_ratio: f64,
    /// Turbine times mechanical efficiency, fraction; `None` if the compressor's efficiency is unknown.
    pub efficiency: Option<f64>,
}

/// The turbine results of every point whose channels are present and plausible; the compressor's gas has the definition of the points'
/// efficiency.
pub fn turbine_points(recording: &Recording, points: &[IdentifiedPoint], gases: &Gases) -> Vec<TurbinePoint> {
    points.iter().filter_map(|point| turbine_point(recording, point, gases)).collect()
}

fn turbine_point(recording: &Recording, point: &IdentifiedPoint, gases: &Gases) -> Option<TurbinePoint> {
    let step = recording.steps.iter().find(|step| step.index == point.step)?;
    let mean = |channel: Channel| {
        let (_, values) = recording.series.get(&channel)?.slice(step.end_s - AVERAGE_S, step.end_s);
        let sum: f64 = values.iter().sum();
        let mean = sum / values.len() as f64;
        (mean.is_finite() && mean > 0.0).then_some(mean)
    };
    let (flow_kg_s, p3_pa, t3_k, p4_pa) =
        (mean(Channel::TurbineFlow)?, mean(Channel::P3)?, mean(Channel::T3)?, mean(Channel::P4)?);
    let expansion_ratio = p3_pa / p4_pa;
    if !(expansion_ratio > 1.0 && point.speed_rpm > 0.0) {
        return None;
    }
    let cp3_j_kgk = gases.turbine.heat_capacity_j_kgk(t3_k);
    let exponent = gases.turbine.gas_constant_j_kgk / cp3_j_kgk;
    let turbine_w = flow_kg_s * cp3_j_kgk * t3_k * (1.0 - expansion_ratio.powf(-exponent));
    let compressor_w = point.eta.filter(|eta| *eta > 0.0).map(|eta| {
        let air = gases.compressor.between(point.p1_pa, point.pressure_ratio * point.p1_pa);
        let rise = isentropic_rise_ratio(point.pressure_ratio, point.t1_k, air);
        let t2_prime_k = compressed_k(point.t1_k, rise, eta, air);
        point.flow_kg_s * air.enthalpy_rise_j_kg(point.t1_k, t2_prime_k)
    });
    Some(TurbinePoint {
        step: point.step,
        speed_parameter_rpm_sqrt_k: point.speed_rpm / t3_k.sqrt(),
        flow_parameter_kg_sqrt_k_s_kpa: flow_kg_s * t3_k.sqrt() / (p3_pa / 1000.0),
        expansion_ratio,
        efficiency: compressor_w.map(|power_w| power_w / turbine_w).filter(|e| e.is_finite()),
    })
}

/// SAE text, turbine: `SP mfp ER Eff`, in order of speed parameter.
pub fn turbine_text(machine: &str, gases: &Gases, points: &[TurbinePoint]) -> String {
    let mut rows: Vec<(&TurbinePoint, f64)> =
        points.iter().filter_map(|p| Some((p, p.efficiency?))).collect();
    rows.sort_by(|a, b| a.0.speed_parameter_rpm_sqrt_k.total_cmp(&b.0.speed_parameter_rpm_sqrt_k));
    let mut text = format!(
        "# turbine of {}\n\
         # Eff: compressor power over isentropic turbine power, total to static: mechanical loss and heat lost before the\n\
         # wheel are in it; too low where the turbine housing still warms up.\n\
         # Gas of the turbine: {}; of the compressor: {}.\n",
        one_line(machine),
        Air::new(gases.turbine, 0.0).description(),
        gases.compressor.description(),
    );
    let without = points.len() - rows.len();
    if without > 0 {
        let _ = writeln!(text, "# {without} points without a compressor efficiency are omitted");
    }
    text.push_str("# SP(rpm/sqrt(K)) mfp(kg-sqrt(K)/s-kPa) ER Eff\n");
    for (p, efficiency) in rows {
        let _ = writeln!(
            text,
            "{} {} {} {efficiency}",
            p.speed_parameter_rpm_sqrt_k, p.flow_parameter_kg_sqrt_k_s_kpa, p.expansion_ratio
        );
    }
    text
}
