//! The compressor's efficiency is higher or lower.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "efficiency_scale",
        "the compressor's efficiency is higher or lower everywhere",
        "eta = s eta_nominal",
        "worn or fouled compressor",
        Submodel::CompressorGas,
        vec![parameter("efficiency_scale", "1", [0.7, 1.3], 1.0, -0.02)],
        |values, rig| rig.model.params.compressor.efficiency_scale_ratio *= values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Instant, T1_K};

    #[test]
    fn the_temperature_rise_grows_as_efficiency_falls() {
        let (nominal, worn) = (Instant::nominal().outputs, Instant::with(&effect(), &[0.97]).outputs);
        let ratio = (worn.t2_prime_k - T1_K) / (nominal.t2_prime_k - T1_K);
        assert!((ratio - 1.0 / 0.97).abs() < 1e-12 && worn.flow_kg_s == nominal.flow_kg_s);
    }
}
