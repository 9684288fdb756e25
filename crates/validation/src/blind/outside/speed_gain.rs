//! The speed pick-up reads high or low.

use super::WITHHELD;
use mapper_core::Channel;
use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The speed pick-up reads high or low.
    #[derive(Debug)]
    pub(super) struct SpeedGain {
        /// Error of the gain, ratio.
        error_ratio = "g" ["1"] -0.1 .. 0.1, neutral 0.0, step 0.01;
    }
}

impl EffectKind for SpeedGain {
    const ABOUT: EffectText = EffectText {
        id: "X_speed_gain",
        name: "speed sensor reads in proportion",
        description: "the speed sensor reads high or low in proportion",
        equation: "N_read = (1 + g) N",
        source: WITHHELD,
        submodel: Submodel::Shaft,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.hook(self)
    }
}

impl Hooks for SpeedGain {
    fn reading(&self, _site: &Site<'_>, channel: Channel, value: f64) -> f64 {
        if channel == Channel::ShaftSpeed { value * (1.0 + self.error_ratio) } else { value }
    }
}
