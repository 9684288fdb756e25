//! A long thin line delays the P2 sensor.

use super::WITHHELD;
use mapper_core::Channel;
use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::TooManyExtraStates;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// A long thin line delays the P2 sensor.
    #[derive(Debug)]
    pub(super) struct SlowPressureLine {
        /// Time constant of the line, s.
        lag_s = "tau" ["s"] 0.0 .. 60.0, neutral 0.0, step 4.0;
    }
}

impl EffectKind for SlowPressureLine {
    const ABOUT: EffectText = EffectText {
        id: "X_slow_pressure_line",
        name: "slow pressure line",
        description: "a slow pressure line to the P2 sensor",
        equation: "dP2_read/dt = (P2 - P2_read)/tau",
        source: WITHHELD,
        submodel: Submodel::P2Sensor,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.instruments.path_mut(Channel::P2).lag_s += self.lag_s;
        Ok(())
    }
}
