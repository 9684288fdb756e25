//! Convection depends on the direction of the heat flow.

use mapper_physics::effect;

effect! {
    pub(crate) struct DirectionalHtc "directional_htc";
    name: "convection that depends on direction",
    description: "convection differs between metal that heats the gas and gas that heats the metal",
    equation: "h f where the metal is hotter than the gas it touches (T1 before, T2' after compression), h elsewhere",
    source: "wall-temperature dependence beyond the viscosity ratio: Sieder and Tate (1936)",
    submodel: CompressorGas, also_shows_in: [CompressorHousing];
    /// Factor f of h if the metal is hotter than its gas.
    hot_metal_ratio = "directional_htc" ["1"] 0.2 .. 3.0, neutral 1.0, step -0.3;
    |effect, rig| rig.model.params.compressor.hot_metal_h_ratio *= effect.hot_metal_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn only_metal_hotter_than_its_gas_has_another_convection() {
        // The housing at 340 K is colder than the gas after the wheel: nothing changes.
        assert_eq!(
            Instant::with(DirectionalHtc { hot_metal_ratio: 0.65 }).outputs.t2_k,
            Instant::nominal().outputs.t2_k
        );
        // At 460 K it is hotter: the conductance, heat over driving difference, is 0.65 times as large.
        let conductance_w_k = |effects: Option<f64>| {
            let mut at = effects
                .map_or_else(Instant::nominal, |f| Instant::with(DirectionalHtc { hot_metal_ratio: f }));
            at.state.tc_k = 460.0;
            at.evaluate();
            at.outputs.compressor_heat_w / (at.outputs.t2_k - 460.0)
        };
        assert!((conductance_w_k(Some(0.65)) / conductance_w_k(None) - 0.65).abs() < 1e-9);
    }
}
