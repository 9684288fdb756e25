//! The T2 probe reads high or low.

use mapper_core::Channel;
use mapper_physics::effect::{Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;

effect_parameters! {
    /// The T2 probe reads high or low.
    #[derive(Debug)]
    pub(crate) struct T2Offset {
        /// Reading minus temperature, K.
        offset_k = "t2_offset" ["K"] -20.0 .. 20.0, neutral 0.0, step 1.5;
    }
}

impl EffectKind for T2Offset {
    const ABOUT: About = About {
        id: "t2_offset",
        name: "offset of T2",
        description: "the probe behind the compressor reads high or low",
        equation: "T2_read = T2 + b",
        source: "calibration of the probe",
        submodel: Submodel::T2Probe,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.instruments.path_mut(Channel::T2).offset += self.offset_k;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_shifted() {
        let shifted = Instant::with(T2Offset { offset_k: -1.5 }).reading(Channel::T2);
        assert!((shifted - Instant::nominal().reading(Channel::T2) - -1.5).abs() < 1e-9);
    }
}
