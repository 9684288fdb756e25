//! Part of the gas recirculates through the wheel.

use mapper_physics::effect;

effect! {
    pub(crate) struct Recirculation "recirculation";
    name: "recirculation",
    description: "part of the flow recirculates, hot, from the outlet of the wheel to its inlet",
    equation: "the wheel pumps (1 + r) m, the map's flow; T2' = T1' (1 + X)/(1 - r X), X = (PR^kappa - 1)/eta",
    source: "mixing balance of a ported shroud or backflow",
    submodel: CompressorFlow, also_shows_in: [CompressorGas];
    /// Recirculated share r of the delivered flow.
    recirculation_ratio = "recirculation" ["1"] 0.0 .. 0.3, neutral 0.0, step 0.03;
    |effect, rig| rig.model.params.compressor.recirculation_ratio += effect.recirculation_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{CP1_J_KGK, Instant};

    /// The mixing balance itself: r m at T2' and m at T1' make the wheel's inlet; the wheel adds X to that.
    #[test]
    fn the_wheel_works_on_the_mixed_gas() {
        let r = 0.05;
        let (nominal, at) =
            (Instant::nominal().outputs, Instant::with(Recirculation { recirculation_ratio: r }).outputs);
        assert!((at.flow_kg_s * (1.0 + r) / nominal.flow_kg_s - 1.0).abs() < 1e-12);
        let mixed_k = (at.t1_prime_k + r * at.t2_prime_k) / (1.0 + r);
        let rise = nominal.t2_prime_k / nominal.t1_prime_k;
        assert!((at.t2_prime_k / (mixed_k * rise) - 1.0).abs() < 1e-12);
        let wheel_power_w = (1.0 + r) * at.flow_kg_s * CP1_J_KGK * (at.t2_prime_k - mixed_k);
        assert!((at.compressor_power_w / wheel_power_w - 1.0).abs() < 1e-12);
    }
}
