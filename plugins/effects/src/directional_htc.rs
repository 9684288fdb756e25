//! Convection depends on the direction of the heat.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "directional_htc",
        "convection is other where the metal heats the gas than where the gas heats the metal",
        "h f where the metal is hotter than the gas it touches (T1 before, T2' after compression), h elsewhere",
        "wall-temperature dependence beyond the viscosity ratio: Sieder and Tate (1936)",
        Submodel::CompressorGas,
        vec![parameter("directional_htc", "1", [0.2, 3.0], 1.0, -0.3)],
        |values, rig| rig.model.params.compressor.hot_metal_h_ratio *= values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn only_metal_hotter_than_its_gas_has_another_convection() {
        // The housing at 340 K is colder than the gas behind the wheel: nothing changes.
        assert_eq!(Instant::with(&effect(), &[0.65]).outputs.t2_k, Instant::nominal().outputs.t2_k);
        // At 460 K it is hotter: the conductance, heat over driving difference, is 0.65 times as large.
        let conductance_w_k = |effects: Option<f64>| {
            let mut at = effects.map_or_else(Instant::nominal, |f| Instant::with(&effect(), &[f]));
            at.state.tc_k = 460.0;
            at.evaluate();
            at.outputs.compressor_heat_w / (at.outputs.t2_k - 460.0)
        };
        assert!((conductance_w_k(Some(0.65)) / conductance_w_k(None) - 0.65).abs() < 1e-9);
    }
}
