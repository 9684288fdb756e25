//! The inner wall of the compressor housing has its own temperature.

use mapper_physics::effect;

effect! {
    // At a fixed G the effect does not vanish as phi goes to 0 (the resistance 1/G of the wall remains): it vanishes as 1/G does.
    // phi = 0 itself is one node.
    pub(crate) struct InnerNode "inner_node";
    name: "inner wall of the compressor housing",
    description: "the inner wall of the compressor housing has its own temperature",
    equation: "phi M c dT_i/dt = q1 + q2 - G (T_i - Tc), (1 - phi) M c dTc/dt = G (T_i - Tc) + bearing - outside",
    source: "two-node wall",
    submodel: CompressorHousing, also_shows_in: [CompressorGas];
    /// Share phi of the inner wall in the housing's heat capacity.
    share_ratio = "phi" ["1"] 0.0 .. 0.9, neutral 0.0, step 0.3;
    /// Conductance G between the inner wall and the outer part, W/K.
    conductance_w_k = "G" ["W/K"] 1.0 .. 500.0, neutral 500.0, step -480.0;
    |effect, rig| if effect.share_ratio > 0.0 {
        rig.model.params.compressor.inner_capacity_ratio = effect.share_ratio;
        rig.model.params.compressor.inner_conductance_w_k = effect.conductance_w_k;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;
    use mapper_physics::simulation::steady;

    #[test]
    fn at_rest_the_wall_passes_what_the_gas_gives_whatever_its_share_of_the_mass() {
        let rest = |phi: f64, g_w_k: f64| {
            let at = Instant::with(InnerNode { share_ratio: phi, conductance_w_k: g_w_k });
            steady::hold_speed(&at.rig.model, 110e3, &at.boundary).unwrap()
        };
        let (thin, thick) = (rest(0.2, 15.0), rest(0.6, 15.0));
        // The steady state is solved to rounding of some 1e-9 W.
        assert!((thin.state.tc_k - thick.state.tc_k).abs() < 1e-6);
        let through_w = 15.0 * (thin.state.inner_k - thin.state.tc_k);
        assert!((thin.outputs.compressor_heat_w - through_w).abs() < 1e-6 && through_w.abs() > 1.0);
        // As 1/G goes to 0 the two nodes become one.
        let one =
            steady::hold_speed(&Instant::nominal().rig.model, 110e3, &Instant::nominal().boundary).unwrap();
        let apart_k = |g_w_k: f64| (rest(0.4, g_w_k).state.tc_k - one.state.tc_k).abs();
        assert!(apart_k(500.0) < 0.06 * apart_k(20.0) && apart_k(20.0) > 0.1);
    }
}
