//! The gas is heated between its probe and the wheel.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "inlet_preheat",
        "the housing heats the gas between the T1 probe and the wheel",
        "T1 rises by UA (Tc - T1)/(m cp); the housing gives UA (Tc - T1)",
        "inlet duct as a conductance",
        Submodel::CompressorGas,
        vec![parameter("inlet_preheat", "W/K", [0.0, 10.0], 0.0, 1.0)],
        |values, rig| rig.model.params.compressor.inlet_conductance_w_k += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{CP1_J_KGK, Instant, T1_K};

    /// 2 W/K between 340 K and the inlet: the housing gives 2 (340 - 298.15) = 83.7 W to the gas.
    #[test]
    fn the_housing_gives_what_the_gas_takes() {
        let (nominal, warm) = (Instant::nominal(), Instant::with(&effect(), &[2.0]));
        let rise_w = (warm.outputs.t1_prime_k - T1_K) * warm.outputs.flow_kg_s * CP1_J_KGK;
        assert!((rise_w - 83.7).abs() < 1e-6, "{rise_w} W");
        assert!(warm.outputs.compressor_heat_w < nominal.outputs.compressor_heat_w);
    }
}
