//! Work and flow coefficients of a map's points, with the apparent work.

use mapper_core::{CompressorMap, ReferenceState};
use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::Gas;
use mapper_physics::laws::compression::isentropic_rise_ratio;

/// Unit of the speed ratio, rpm. Bound: the estimate does not depend on it, nor on the wheel's diameter.
const UNIT_SPEED_RPM: f64 = 100_000.0;
/// Share of the stage's temperature rise up to the wheel's exit. Source: the degree of reaction of radial wheels (Casey and Robinson,
/// Radial Flow Turbocompressors, 2021).
const REACTION: f64 = 0.6;
/// Density over temperature along the wheel. Source: 1/(n - 1) of a polytrope with n = 1.5.
const DENSITY_EXPONENT: f64 = 2.0;
/// Minimum efficiency of a point on the choke side, over the best of its line. Bound: below, inlet choking determines the work.
const MIN_EFFICIENCY_OF_BEST_RATIO: f64 = 0.85;

/// Work and flow coefficients of a point at the map's reference state.
#[derive(Debug, Clone, Copy)]
pub struct WorkPoint {
    /// Speed line of the map.
    pub line: usize,
    /// Corrected speed of the line over [`UNIT_SPEED_RPM`].
    pub speed_ratio: f64,
    /// Corrected flow, kg/s.
    pub flow_kg_s: f64,
    /// Apparent specific work over the square of speed, J/kg.
    pub work_coefficient: f64,
    /// Inlet flow over the speed ratio, kg/s.
    pub inlet_flow: f64,
    /// The same with the density at the wheel's exit, kg/s.
    pub exit_flow: f64,
}

impl WorkPoint {
    /// Increase of the work coefficient per watt of heat, J/(kg W).
    pub fn work_coefficient_per_watt(&self) -> f64 {
        1.0 / (self.flow_kg_s * self.speed_ratio * self.speed_ratio)
    }
}

/// Dry air with the map's definition of efficiency; by enthalpy if the map does not name one.
pub fn air_of(map: &CompressorMap) -> Air {
    Air::new(Gas::air(), 0.0).with_efficiency(map.efficiency.unwrap_or_default())
}

/// Isentropic specific work from the reference temperature, J/kg.
pub fn isentropic_work_j_kg(reference: ReferenceState, pressure_ratio: f64, air: Air) -> f64 {
    let (t_k, p_pa) = (reference.t_ref_k, reference.p_ref_pa);
    let air = air.between(p_pa, pressure_ratio * p_pa);
    air.heat_capacity_j_kgk(t_k) * t_k * isentropic_rise_ratio(pressure_ratio, t_k, air)
}

/// The points with an efficiency that lie outside choke.
pub fn work_points(map: &CompressorMap) -> Vec<WorkPoint> {
    let (reference, air) = (map.reference, air_of(map));
    let mut points = Vec::new();
    for (index, line) in map.lines.iter().enumerate() {
        let usable = || {
            line.points.iter().filter_map(|point| {
                let eta = point.eta.filter(|eta| *eta > 0.0)?;
                (point.pressure_ratio > 1.0 && point.flow_corrected_kg_s > 0.0).then_some((point, eta))
            })
        };
        let best = usable().max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((best, best_eta)) = best else { continue };
        for (point, eta) in usable() {
            let flow_kg_s = point.flow_corrected_kg_s;
            if flow_kg_s > best.flow_corrected_kg_s && eta < MIN_EFFICIENCY_OF_BEST_RATIO * best_eta {
                continue;
            }
            let speed_ratio = line.speed_corrected_rpm / UNIT_SPEED_RPM;
            let work_j_kg = isentropic_work_j_kg(reference, point.pressure_ratio, air) / eta;
            let t_k = reference.t_ref_k;
            let rise_ratio = work_j_kg / (air.heat_capacity_j_kgk(t_k) * t_k);
            let inlet_flow = flow_kg_s / speed_ratio;
            points.push(WorkPoint {
                line: index,
                speed_ratio,
                flow_kg_s,
                work_coefficient: work_j_kg / (speed_ratio * speed_ratio),
                inlet_flow,
                exit_flow: inlet_flow / (1.0 + REACTION * rise_ratio).powf(DENSITY_EXPONENT),
            });
        }
    }
    points
}
