//! The compressor's flow meter reads high or low.

use mapper_core::Channel;
use mapper_physics::effect::{Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;

effect_parameters! {
    /// The compressor's flow meter reads high or low.
    #[derive(Debug)]
    pub(crate) struct FlowmeterGain {
        /// Reading over flow.
        gain_ratio = "flowmeter_gain" ["1"] 0.7 .. 1.3, neutral 1.0, step 0.03;
    }
}

impl EffectKind for FlowmeterGain {
    const ABOUT: About = About {
        id: "flowmeter_gain",
        name: "flow meter reads in proportion",
        description: "the compressor's flow meter reads high or low in proportion",
        equation: "m_read = s m",
        source: "calibration of the meter",
        submodel: Submodel::FlowMeter,
        also_shows_in: &[Submodel::CompressorFlow],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.instruments.path_mut(Channel::CompressorFlow).gain_ratio *= self.gain_ratio;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_multiplied_and_the_flow_is_not() {
        let at = Instant::with(FlowmeterGain { gain_ratio: 1.03 });
        assert!((at.reading(Channel::CompressorFlow) / at.outputs.flow_kg_s - 1.03).abs() < 1e-12);
        assert_eq!(at.outputs.flow_kg_s, Instant::nominal().outputs.flow_kg_s);
    }
}
