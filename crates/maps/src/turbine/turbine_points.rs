//! Steady points of a turbine as points of its map, with the uncertainty of flow and efficiency by the offsets and gains of the sensors.

use crate::table::reduced_turbine_point;
use mapper_core::{Channel, DeclaredUncertainty, MeasuredTurbinePoint, TurbineMapPoint};
use serde::Serialize;
use std::collections::BTreeMap;

/// A point of a turbine map with its standard uncertainties.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReducedTurbinePoint {
    /// The point.
    #[serde(flatten)]
    pub point: TurbineMapPoint,
    /// Standard uncertainty of the flow parameter, kg K^0.5/(s kPa).
    pub flow_standard_error: f64,
    /// Standard uncertainty of the efficiency, fraction.
    pub efficiency_standard_error: Option<f64>,
}

/// Access to one reading of a point.
type Reading = fn(&mut MeasuredTurbinePoint) -> Option<&mut f64>;

/// The readings that flow and efficiency depend on.
const READINGS: [(Channel, Reading); 5] = [
    (Channel::T3, |point| Some(&mut point.t3_k)),
    (Channel::P3, |point| Some(&mut point.p3_pa)),
    (Channel::P4, |point| Some(&mut point.p4_pa)),
    (Channel::T4, |point| point.t4_k.as_mut()),
    (Channel::TurbineFlow, |point| Some(&mut point.flow_kg_s)),
];

/// The points of a turbine map, in order. Each sensor is moved by one standard deviation, and the point is computed again.
pub fn reduce_turbine(
    measured: &[MeasuredTurbinePoint],
    declared: &BTreeMap<Channel, DeclaredUncertainty>,
) -> Vec<ReducedTurbinePoint> {
    measured.iter().map(|point| reduced(point, declared)).collect()
}

fn reduced(
    measured: &MeasuredTurbinePoint,
    declared: &BTreeMap<Channel, DeclaredUncertainty>,
) -> ReducedTurbinePoint {
    let point = reduced_turbine_point(measured);
    let (mut of_flow, mut of_efficiency) = (0.0_f64, 0.0_f64);
    for (channel, reading) in READINGS {
        let declared = declared.get(&channel).copied().unwrap_or_default();
        let mut moved = *measured;
        let Some(value) = reading(&mut moved) else { continue };
        *value += declared.fixed_sigma(channel, *value);
        let moved = reduced_turbine_point(&moved);
        of_flow = of_flow.hypot(moved.flow_parameter_kg_sqrt_k_s_kpa - point.flow_parameter_kg_sqrt_k_s_kpa);
        let change = moved.efficiency.zip(point.efficiency).map_or(0.0, |(moved, eta)| moved - eta);
        of_efficiency = of_efficiency.hypot(change);
    }
    ReducedTurbinePoint {
        point,
        flow_standard_error: of_flow,
        efficiency_standard_error: point.efficiency.map(|_| of_efficiency),
    }
}
