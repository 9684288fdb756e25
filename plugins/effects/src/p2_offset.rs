//! The P2 sensor reads high or low.

use mapper_core::Channel;
use mapper_physics::effect::{Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;

effect_parameters! {
    /// The P2 sensor reads high or low.
    #[derive(Debug)]
    pub(crate) struct P2Offset {
        /// Reading minus pressure, Pa.
        offset_pa = "p2_offset" ["Pa"] -20000.0 .. 20000.0, neutral 0.0, step 800.0;
    }
}

impl EffectKind for P2Offset {
    const ABOUT: About = About {
        id: "p2_offset",
        name: "offset of P2",
        description: "the pressure sensor behind the compressor reads high or low",
        equation: "P2_read = P2 + b",
        source: "calibration of the sensor",
        submodel: Submodel::P2Sensor,
        also_shows_in: &[Submodel::Outlet],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.instruments.path_mut(Channel::P2).offset += self.offset_pa;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_shifted() {
        let shifted = Instant::with(P2Offset { offset_pa: -700.0 }).reading(Channel::P2);
        assert!((shifted - Instant::nominal().reading(Channel::P2) - -700.0).abs() < 1e-9);
    }
}
