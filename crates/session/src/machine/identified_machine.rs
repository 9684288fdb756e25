//! The declared machine with what a recording identified: convection, probe and split of the compressor; flow, efficiency and housing of the turbine.

use mapper_core::{ThermalModel, TurbineHousing, TurbinePoint, Verdict};
use mapper_numerics::root::minimise;
use mapper_numerics::statistics::mean;
use mapper_physics::laws::turbine::{TurbineInlet, isentropic_drop_j_kg};
use mapper_physics::machine::params::{BoundaryConditions, Params, TurbineParams};

pub(crate) fn with_identified(declared: &Params, found: &ThermalModel) -> Params {
    let mut params = *declared;
    let compressor = &mut params.compressor;
    compressor.internal_area_m2 = found.internal_area_m2;
    if let Some(law) = &found.convection
        && let Some((a, b)) = law.coefficient.value.zip(law.exponent.value)
    {
        compressor.nusselt_coefficient = a;
        compressor.nusselt_exponent = b;
        compressor.outlet_diameter_m = law.diameter_m;
    }
    if let Some(alpha) = found.alpha_area_ratio.value {
        compressor.alpha_area_ratio = alpha;
    }
    if let Some(factor) = found.heating_cooling_ratio.value {
        compressor.hot_metal_h_ratio = factor;
    }
    if let Some(inlet) = &found.inlet {
        compressor.inlet_convection = inlet.convection;
        compressor.inlet_diameter_m = inlet.diameter_m;
    }
    if let Some(diameter_m) = found.probe_diameter_m.value {
        params.t2_probe_diameter_m = diameter_m;
    }
    params
}

/// Least number of turbine points. Bound: twice the number of fitted values.
const MIN_POINTS: usize = 6;
/// Blade-speed ratios between which the best efficiency is sought, and its resolution. Source: 0.5 to 0.8 for radial and mixed-flow turbines
/// (Watson and Janota, ch. 5).
const BLADE_SPEED_RATIOS: (f64, f64, f64) = (0.45, 0.9, 1e-5);
/// Outlet pressure at which a point's expansion is computed, Pa. Bound: an ideal gas, whose expansion depends on the ratio alone.
const ANY_OUTLET_PA: f64 = 1e5;

/// The turbine of a machine as identified: flow, and the parabola of the efficiency over the blade-speed ratio, from its points; the housing from its
/// balance. The efficiency contains the bearing loss, so the bearing friction is 0. `None` with too few points.
pub(crate) fn with_identified_turbine(
    declared: &Params,
    points: &[&TurbinePoint],
    housing: Option<&TurbineHousing>,
) -> Option<Params> {
    let mut params = *declared;
    let gas = params.turbine.gas;
    let adiabatic = TurbineParams { internal_area_m2: 0.0, ..params.turbine };
    let mut flow_ratios = Vec::new();
    let mut efficiencies = Vec::new();
    for point in points.iter().filter(|point| point.verdict != Verdict::Unusable) {
        let Some(efficiency) = point.efficiency else { continue };
        let (p3_pa, t3_k) = (point.expansion_ratio * ANY_OUTLET_PA, point.t3_prime_k);
        let boundary =
            BoundaryConditions { p3_pa, t3_k, p4_pa: ANY_OUTLET_PA, ..BoundaryConditions::default() };
        if boundary.check().is_err() {
            continue;
        }
        let inlet = TurbineInlet::new(&adiabatic, &boundary);
        let drop_j_kg = isentropic_drop_j_kg(gas, t3_k, point.expansion_ratio);
        let speed_rad_s = point.blade_speed_ratio * (2.0 * drop_j_kg).sqrt() / params.turbine.wheel_radius_m;
        let state = inlet.at(t3_k, speed_rad_s);
        // The model's efficiency is over a drop with the heat capacity at the inlet.
        let model_drop_j_kg = state.power_w / (inlet.flow_kg_s * state.efficiency);
        efficiencies.push((state.blade_speed_ratio, efficiency * drop_j_kg / model_drop_j_kg));
        let law = inlet.flow_kg_s * t3_k.sqrt() / (p3_pa / PA_PER_KPA);
        flow_ratios.push((point.flow_parameter_kg_sqrt_k_s_kpa / law).ln());
    }
    if efficiencies.len() < MIN_POINTS {
        return None;
    }
    params.turbine.choked_flow_kg_s *= mean(&flow_ratios)?.exp();
    let unit = TurbineParams { peak_efficiency: 1.0, ..params.turbine };
    // The best factor at this place of the peak, and what it leaves.
    let fit = |peak: f64| {
        let shape = |ratio: f64| TurbineInlet::efficiency(&unit, ratio, peak);
        let (product, square) = efficiencies.iter().fold((0.0, 0.0), |(product, square), (ratio, value)| {
            (product + shape(*ratio) * value, square + shape(*ratio).powi(2))
        });
        let best = product / square;
        let left = efficiencies.iter().map(|(ratio, value)| (value - best * shape(*ratio)).powi(2)).sum();
        (best, left)
    };
    let (low, high, resolution) = BLADE_SPEED_RATIOS;
    let peak = minimise(low, high, resolution, |peak| -> f64 { fit(peak).1 }).at;
    params.turbine.peak_blade_speed_ratio = peak;
    params.turbine.peak_efficiency = fit(peak).0;
    params.bearing_friction_w_s2 = 0.0;
    if let Some(housing) = housing {
        let exponent = housing.exponent[0];
        params.turbine.nusselt_exponent = exponent;
        params.turbine.nusselt_coefficient = housing.nusselt[0] / housing.reynolds.powf(exponent);
        params.turbine.housing_mass_kg *= housing.capacity_ratio[0];
        params.turbine.external_area_m2 *= housing.external_heat_ratio[0];
    }
    Some(params)
}

/// Pascals in a kilopascal. Source: definition.
const PA_PER_KPA: f64 = 1e3;

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::TurbineCommonErrors;
    use mapper_physics::machine::params::rad_s_of_rpm;

    /// Another turbine's points, by the law of docs/reference/model.md, give that turbine: flow 0.085 kg/s, 0.70 at a blade-speed ratio of 0.6.
    #[test]
    fn the_turbine_of_the_points_is_found() {
        let declared = Params::default();
        let other = TurbineParams {
            choked_flow_kg_s: 0.085,
            peak_efficiency: 0.70,
            peak_blade_speed_ratio: 0.6,
            internal_area_m2: 0.0,
            ..declared.turbine
        };
        let mut points = Vec::new();
        for (step, (speed_rpm, ratio)) in
            [50e3, 80e3, 110e3, 140e3].into_iter().zip([1.12, 1.3, 1.6, 2.2]).enumerate()
        {
            for factor in [0.95, 1.0, 1.1] {
                let expansion_ratio = ratio * factor;
                let boundary = BoundaryConditions {
                    p3_pa: 110e3 * expansion_ratio,
                    p4_pa: 110e3,
                    t3_k: 760.0,
                    ..BoundaryConditions::default()
                };
                let inlet = TurbineInlet::new(&other, &boundary);
                let state = inlet.at(500.0, rad_s_of_rpm(speed_rpm));
                let drop_j_kg = isentropic_drop_j_kg(other.gas, 760.0, expansion_ratio);
                points.push(TurbinePoint {
                    step,
                    vane_position: None,
                    speed_parameter_rpm_sqrt_k: speed_rpm / 760f64.sqrt(),
                    flow_parameter_kg_sqrt_k_s_kpa: inlet.flow_kg_s * 760f64.sqrt()
                        / (0.11 * expansion_ratio * 1e3),
                    flow_low: 0.0,
                    flow_high: 1.0,
                    expansion_ratio,
                    expansion_ratio_standard_error: 0.0,
                    blade_speed_ratio: rad_s_of_rpm(speed_rpm) * other.wheel_radius_m
                        / (2.0 * drop_j_kg).sqrt(),
                    power_w: Some(state.power_w),
                    heat_w: 0.0,
                    heat_standard_error_w: 0.0,
                    t3_prime_k: 760.0,
                    efficiency: Some(state.power_w / (inlet.flow_kg_s * drop_j_kg)),
                    efficiency_low: None,
                    efficiency_high: None,
                    budget: None,
                    common: TurbineCommonErrors::default(),
                    verdict: Verdict::Good,
                    doubts: Vec::new(),
                });
            }
        }
        let points: Vec<&TurbinePoint> = points.iter().collect();
        let found = with_identified_turbine(&declared, &points, None).unwrap().turbine;
        // The points obey the law exactly.
        assert!((found.choked_flow_kg_s / 0.085 - 1.0).abs() < 1e-6, "{found:?}");
        assert!((found.peak_efficiency / 0.70 - 1.0).abs() < 1e-4, "{found:?}");
        assert!((found.peak_blade_speed_ratio / 0.6 - 1.0).abs() < 1e-3, "{found:?}");
        assert_eq!(with_identified_turbine(&declared, &points[..5], None), None);
    }
}
