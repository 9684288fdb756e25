//! The probe in the housing reads high or low.

use mapper_core::Channel;
use mapper_physics::effect::{Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;

effect_parameters! {
    /// The probe in the housing reads high or low.
    #[derive(Debug)]
    pub(crate) struct TcOffset {
        /// Reading minus temperature, K.
        offset_k = "tc_offset" ["K"] -30.0 .. 30.0, neutral 0.0, step 2.0;
    }
}

impl EffectKind for TcOffset {
    const ABOUT: About = About {
        id: "tc_offset",
        name: "offset of Tc",
        description: "the probe in the compressor housing reads high or low",
        equation: "Tc_read = Tc + b",
        source: "calibration or place of the probe",
        submodel: Submodel::TcProbe,
        also_shows_in: &[Submodel::CompressorHousing],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.instruments.path_mut(Channel::Tc).offset += self.offset_k;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_shifted() {
        let shifted = Instant::with(TcOffset { offset_k: 2.0 }).reading(Channel::Tc);
        assert!((shifted - Instant::nominal().reading(Channel::Tc) - 2.0).abs() < 1e-9);
    }
}
