//! The compressor housing is attached to a cold mount.

use super::WITHHELD;
use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The compressor housing is attached to a cold mount.
    #[derive(Debug)]
    pub(super) struct MountConduction {
        /// Conductance to the mount, W/K.
        conductance_w_k = "G" ["W/K"] 0.0 .. 20.0, neutral 0.0, step 1.5;
    }
}

impl EffectKind for MountConduction {
    const ABOUT: EffectText = EffectText {
        id: "X_mount_conduction",
        name: "conduction to the mount",
        description: "the compressor housing conducts to a mount at 20 degC",
        equation: "G (293.15 K - Tc) to the compressor housing",
        source: WITHHELD,
        submodel: Submodel::CompressorHousing,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.hook(self)
    }
}

impl Hooks for MountConduction {
    fn heat_to_compressor_w(&self, site: &Site<'_>) -> f64 {
        self.conductance_w_k * (293.15 - site.state.tc_k)
    }
}
