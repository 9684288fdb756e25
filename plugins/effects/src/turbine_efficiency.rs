//! The turbine delivers more or less power.

use mapper_physics::effect;

effect! {
    pub(crate) struct TurbineEfficiency "turbine_efficiency";
    name: "turbine efficiency",
    description: "the turbine's efficiency is higher or lower everywhere",
    equation: "eta_t = s eta_t,nominal",
    source: "worn or fouled turbine",
    submodel: Shaft, also_shows_in: [];
    /// Turbine efficiency over the nominal one.
    scale_ratio = "turbine_efficiency" ["1"] 0.5 .. 1.3, neutral 1.0, step -0.04;
    |effect, rig| rig.model.params.turbine.peak_efficiency *= effect.scale_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_drop_over_the_wheel_is_multiplied() {
        let drop_k = |at: Instant| at.outputs.turbine.t3_prime_k - at.outputs.turbine.t4_k;
        let ratio =
            drop_k(Instant::with(TurbineEfficiency { scale_ratio: 0.96 })) / drop_k(Instant::nominal());
        assert!((ratio - 0.96).abs() < 1e-12);
    }
}
