//! The shaft rubs with a torque that does not depend on speed.

use super::WITHHELD;
use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The shaft rubs with a torque that does not depend on speed.
    #[derive(Debug)]
    pub(super) struct CoulombFriction {
        /// Torque, N m.
        torque_nm = "M" ["N m"] 0.0 .. 0.2, neutral 0.0, step 0.012;
    }
}

impl EffectKind for CoulombFriction {
    const ABOUT: EffectText = EffectText {
        id: "X_coulomb_friction",
        name: "rubbing shaft",
        description: "the shaft rubs with a constant torque",
        equation: "-M on the shaft",
        source: WITHHELD,
        submodel: Submodel::Shaft,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.hook(self)
    }
}

impl Hooks for CoulombFriction {
    fn shaft_torque_nm(&self, _site: &Site<'_>) -> f64 {
        -self.torque_nm
    }
}
