//! The turbine delivers more or less power.

use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::TooManyExtraStates;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The turbine delivers more or less power.
    #[derive(Debug)]
    pub(crate) struct TurbineEfficiency {
        /// Turbine efficiency over the nominal one.
        scale_ratio = "turbine_efficiency" ["1"] 0.5 .. 1.3, neutral 1.0, step -0.04;
    }
}

impl EffectKind for TurbineEfficiency {
    const ABOUT: EffectText = EffectText {
        id: "turbine_efficiency",
        name: "turbine efficiency",
        description: "the turbine's efficiency is higher or lower everywhere",
        equation: "eta_t = s eta_t,nominal",
        source: "worn or fouled turbine",
        submodel: Submodel::Shaft,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.model.params.turbine.peak_efficiency *= self.scale_ratio;
        Ok(())
    }
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
