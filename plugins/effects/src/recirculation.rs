//! Gas goes in a circle through the wheel.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "recirculation",
        "part of the flow comes back, hot, from behind the wheel to its inlet",
        "the wheel pumps (1 + r) m, the map's flow; T2' = T1' (1 + X)/(1 - r X), X = (PR^kappa - 1)/eta",
        "mixing balance of a ported shroud or backflow",
        Submodel::CompressorFlow,
        vec![parameter("recirculation", "1", [0.0, 0.3], 0.0, 0.03)],
        |values, rig| rig.model.params.compressor.recirculation_ratio += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{CP1_J_KGK, Instant};

    /// The mixing balance itself: r m at T2' and m at T1' make the wheel's inlet; the wheel adds X to that.
    #[test]
    fn the_wheel_works_on_the_mixed_gas() {
        let r = 0.05;
        let (nominal, at) = (Instant::nominal().outputs, Instant::with(&effect(), &[r]).outputs);
        assert!((at.flow_kg_s * (1.0 + r) / nominal.flow_kg_s - 1.0).abs() < 1e-12);
        let mixed_k = (at.t1_prime_k + r * at.t2_prime_k) / (1.0 + r);
        let rise = nominal.t2_prime_k / nominal.t1_prime_k;
        assert!((at.t2_prime_k / (mixed_k * rise) - 1.0).abs() < 1e-12);
        let wheel_power_w = (1.0 + r) * at.flow_kg_s * CP1_J_KGK * (at.t2_prime_k - mixed_k);
        assert!((at.compressor_power_w / wheel_power_w - 1.0).abs() < 1e-12);
    }
}
