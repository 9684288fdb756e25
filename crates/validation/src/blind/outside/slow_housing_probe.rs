//! The probe in the housing is slow.

use super::WITHHELD;
use mapper_core::Channel;
use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::TooManyExtraStates;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The probe in the housing is slow.
    #[derive(Debug)]
    pub(super) struct SlowHousingProbe {
        /// Time constant of the probe, s.
        lag_s = "tau" ["s"] 0.0 .. 120.0, neutral 0.0, step 12.0;
    }
}

impl EffectKind for SlowHousingProbe {
    const ABOUT: EffectText = EffectText {
        id: "X_slow_housing_probe",
        name: "slow housing probe",
        description: "a slow probe in the compressor housing",
        equation: "dTc_read/dt = (Tc - Tc_read)/tau",
        source: WITHHELD,
        submodel: Submodel::TcProbe,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.instruments.path_mut(Channel::Tc).lag_s += self.lag_s;
        Ok(())
    }
}
