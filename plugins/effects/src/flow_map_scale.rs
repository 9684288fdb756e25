//! The compressor moves more or less.

use mapper_physics::effect::{Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;

effect_parameters! {
    /// The compressor moves more or less.
    #[derive(Debug)]
    pub(crate) struct FlowMapScale {
        /// Corrected flow over the map's.
        scale_ratio = "flow_map_scale" ["1"] 0.7 .. 1.3, neutral 1.0, step 0.03;
    }
}

impl EffectKind for FlowMapScale {
    const ABOUT: About = About {
        id: "flow_map_scale",
        description: "the compressor delivers more or less flow at equal speed and pressure ratio",
        equation: "m_corr = s m_corr,nominal; the efficiency stays where it is on the speed line",
        source: "worn or fouled compressor, other trim",
        submodel: Submodel::CompressorFlow,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.model.params.compressor.flow_scale_ratio *= self.scale_ratio;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn flow_is_multiplied_at_equal_efficiency() {
        let (nominal, other) =
            (Instant::nominal().outputs, Instant::with(FlowMapScale { scale_ratio: 1.03 }).outputs);
        assert!((other.flow_kg_s / nominal.flow_kg_s - 1.03).abs() < 1e-12);
        assert_eq!(other.efficiency, nominal.efficiency);
    }
}
