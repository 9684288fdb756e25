//! The T1 probe reads high or low.

use mapper_core::Channel;
use mapper_physics::effect::{Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;

effect_parameters! {
    /// The T1 probe reads high or low.
    #[derive(Debug)]
    pub(crate) struct T1Offset {
        /// Reading minus temperature, K.
        offset_k = "t1_offset" ["K"] -20.0 .. 20.0, neutral 0.0, step 1.5;
    }
}

impl EffectKind for T1Offset {
    const ABOUT: About = About {
        id: "t1_offset",
        name: "offset of T1",
        description: "the probe before the compressor reads high or low",
        equation: "T1_read = T1 + b",
        source: "calibration of the probe",
        submodel: Submodel::T1Probe,
        also_shows_in: &[Submodel::CompressorGas],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.instruments.path_mut(Channel::T1).offset += self.offset_k;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_shifted() {
        let shifted = Instant::with(T1Offset { offset_k: 0.8 }).reading(Channel::T1);
        assert!((shifted - Instant::nominal().reading(Channel::T1) - 0.8).abs() < 1e-9);
    }
}
