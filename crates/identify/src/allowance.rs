//! What is efficiency for every method but may be something else: recirculation through the wheel, recovery of the T2 probe, and heat that reaches
//! the gas behind the wheel without passing the housing. No recording of T2 and Tc separates them from the efficiency, so they are not part of its
//! interval: they are stated next to it, with the sizes that `tolerances:` declares.
//!
//! A recirculating share r lowers the efficiency by `r (1 + X)` of itself, with X the rise over T1 (mixing at the inlet, to first order). A reading
//! of T2 that is off by dT moves it by dT over the rise, and so does heat Q with `dT = Q/(m cp)`.

use crate::IdentifyConfig;
use crate::single_step::budgets;
use crate::step_data::end_state::EndState;
use mapper_core::{UncertaintyBudget, half_width_95};
use mapper_physics::laws::compression::isentropic_rise_ratio;
use mapper_physics::laws::thermocouple::dynamic_temperature_k;

/// The parts of an efficiency that may be something else; `None` without compression.
pub(crate) fn budget(eta: f64, state: &EndState, config: &IdentifyConfig) -> Option<UncertaintyBudget> {
    let (sizes, air) = (&config.allowance, config.air);
    let rise_ratio = isentropic_rise_ratio(state.pressure_ratio, state.t1_k, air) / eta;
    let rise_k = state.t1_k * rise_ratio;
    if !(rise_k > 0.0 && rise_k.is_finite()) {
        return None;
    }
    let (t2_k, p2_pa) = (state.t1_k + rise_k, state.p1_pa * state.pressure_ratio);
    let gas_constant_j_kgk = air.gas_constant_j_kgk();
    let dynamic_k =
        dynamic_temperature_k(config.outlet_diameter_m, state.flow_kg_s, p2_pa, t2_k, gas_constant_j_kgk);
    let capacity_w_k = state.flow_kg_s * air.heat_capacity_j_kgk(t2_k);
    let heated_k = (state.bearing_k.unwrap_or(t2_k) - t2_k) / capacity_w_k;
    let row = |name: &str, sigma: f64, unit: &str, sensitivity: f64| {
        budgets::row(name.to_owned(), sigma, unit, sensitivity, sensitivity * sigma)
    };
    let rows = vec![
        row("recirculation", sizes.recirculation_ratio, "1", -eta * (1.0 + rise_ratio)),
        row("recovery of the T2 probe", sizes.t2_recovery_ratio, "1", eta * dynamic_k / rise_k),
        row("heat behind the wheel", sizes.heat_behind_wheel_w_k, "W/K", -eta * heated_k / rise_k),
    ];
    let mut budget = UncertaintyBudget::of(eta, rows, 0.0);
    budget.expanded_uncertainty = half_width_95(budget.combined_standard_uncertainty());
    budget.coverage_factor = half_width_95(1.0);
    Some(budget)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_physics::laws::compression::{Wheel, apparent_efficiency};

    /// The effects themselves: a wheel whose flow recirculates, a probe that reads too low, and a flow that is heated.
    #[test]
    fn the_effects_themselves_change_the_efficiency_by_as_much() {
        let config = IdentifyConfig::default();
        let state = EndState {
            speed_rpm: 100e3,
            flow_kg_s: 0.06,
            t1_k: 298.0,
            p1_pa: 100e3,
            pressure_ratio: 2.0,
            bearing_k: Some(400.0),
        };
        let (eta, air) = (0.7, config.air);
        let found = budget(eta, &state, &config).unwrap();
        let rise = isentropic_rise_ratio(2.0, 298.0, air);
        let wheel = |recirculation_ratio: f64| {
            let wheel =
                Wheel { t1_k: 298.0, isentropic_rise_ratio: rise, efficiency: eta, recirculation_ratio, air };
            wheel.compress(298.0).0
        };
        let t2_k = wheel(0.0);
        let changed = |t2_k: f64| apparent_efficiency(2.0, 298.0, t2_k, air) - eta;
        let capacity_w_k = 0.06 * air.heat_capacity_j_kgk(t2_k);
        let heated_k = config.allowance.heat_behind_wheel_w_k * (400.0 - t2_k) / capacity_w_k;
        let dynamic_k =
            dynamic_temperature_k(config.outlet_diameter_m, 0.06, 200e3, t2_k, air.gas_constant_j_kgk());
        let direct = [
            changed(wheel(config.allowance.recirculation_ratio)),
            changed(t2_k - config.allowance.t2_recovery_ratio * dynamic_k),
            changed(t2_k + heated_k),
        ];
        for (row, direct) in found.rows.iter().zip(direct) {
            // First order; the largest change is 1 % of the efficiency.
            assert!((row.contribution / direct - 1.0).abs() < 0.02, "{}: {direct}", row.source);
        }
    }
}
