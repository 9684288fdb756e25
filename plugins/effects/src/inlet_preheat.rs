//! The gas is heated between its probe and the wheel.

use mapper_physics::effect;

effect! {
    pub(crate) struct InletPreheat "inlet_preheat";
    name: "gas heated in the inlet",
    description: "the housing heats the gas between the T1 probe and the wheel",
    equation: "T1 rises by UA (Tc - T1)/(m cp); the housing gives UA (Tc - T1)",
    source: "inlet duct as a conductance",
    submodel: CompressorGas, also_shows_in: [CompressorHousing];
    /// Conductance UA from housing to gas, W/K.
    conductance_w_k = "inlet_preheat" ["W/K"] 0.0 .. 10.0, neutral 0.0, step 1.0;
    |effect, rig| rig.model.params.compressor.inlet_conductance_w_k += effect.conductance_w_k
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{CP1_J_KGK, Instant, T1_K};

    /// 2 W/K between 340 K and the inlet: the gas takes 2 (340 - 298.15) = 83.7 W from the housing.
    #[test]
    fn the_housing_gives_what_the_gas_takes() {
        let (nominal, warm) = (Instant::nominal(), Instant::with(InletPreheat { conductance_w_k: 2.0 }));
        let rise_w = (warm.outputs.t1_prime_k - T1_K) * warm.outputs.flow_kg_s * CP1_J_KGK;
        assert!((rise_w - 83.7).abs() < 1e-6, "{rise_w} W");
        assert!(warm.outputs.compressor_heat_w < nominal.outputs.compressor_heat_w);
    }
}
