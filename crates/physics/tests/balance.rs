//! Energy balance of steady states, in the model's own bookkeeping.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::InletConvection;
use mapper_physics::laws::housing;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Shaft: turbine power is compressor power. Metal: what the gases give goes to oil and cell. Volume: what flows
    /// in flows out. All to 1e-6 of the shaft power.
    #[test]
    fn nothing_is_lost_at_rest(
        speed_rpm in 40e3..160e3f64,
        valve_opening_ratio in 0.5..2.5f64,
        alpha in 0.0..0.5f64,
        own_inlet in any::<bool>(),
        t3_k in 400.0..900.0f64,
        oil_k in 300.0..380.0f64,
    ) {
        let mut model = Model::nominal();
        model.params.compressor.alpha_area_ratio = alpha;
        if own_inlet {
            model.params.compressor.inlet_convection = InletConvection::Own;
        }
        let boundary = BoundaryConditions { valve_opening_ratio, t3_k, oil_temperature_k: oil_k, ..Default::default() };
        let rest = steady::hold_speed(&model, speed_rpm, &boundary).unwrap();
        let outputs = rest.outputs;
        let tolerance_w = 1e-6 * outputs.turbine.power_w;
        prop_assert!((outputs.turbine.power_w - outputs.compressor_power_w).abs() < tolerance_w);
        let oil_w = model.params.bearing.oil_conductance_w_k * (outputs.bearing_k - oil_k);
        let gases_w = outputs.compressor_heat_w + outputs.turbine.heat_w;
        let cell_w = outputs.compressor_external_heat_w + outputs.turbine_external_heat_w;
        prop_assert!((gases_w - oil_w - cell_w).abs() < tolerance_w, "{gases_w} {oil_w} {cell_w}");
        prop_assert!((outputs.flow_kg_s / outputs.valve_flow_kg_s - 1.0).abs() < 1e-6);
        // The bearing node stores nothing.
        let through_w = housing::bearing_conductance_w_k(&model.params.bearing)
            * (rest.state.tc_k + rest.state.tt_k - 2.0 * outputs.bearing_k);
        prop_assert!((through_w - oil_w).abs() < tolerance_w);
    }

    /// The speed that a P3 settles at is the speed that needs this P3.
    #[test]
    fn settling_inverts_holding(speed_rpm in 40e3..160e3f64, valve_opening_ratio in 0.5..2.5f64) {
        let model = Model::nominal();
        let boundary = BoundaryConditions { valve_opening_ratio, ..Default::default() };
        let held = steady::hold_speed(&model, speed_rpm, &boundary).unwrap();
        let settled = steady::settle_under(&model, &held.boundary).unwrap();
        prop_assert!((settled.state.shaft_speed_rpm() / speed_rpm - 1.0).abs() < 1e-8);
    }
}
