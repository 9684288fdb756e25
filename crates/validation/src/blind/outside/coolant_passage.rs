//! Water flows through the compressor housing.

use super::WITHHELD;
use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

/// Temperature of the water, K.
const WATER_K: f64 = 358.15;

effect_parameters! {
    /// Water flows through the compressor housing.
    #[derive(Debug)]
    pub(super) struct CoolantPassage {
        /// Conductance to the water, W/K.
        conductance_w_k = "G" ["W/K"] 0.0 .. 20.0, neutral 0.0, step 1.5;
    }
}

impl EffectKind for CoolantPassage {
    const ABOUT: EffectText = EffectText {
        id: "X_coolant_passage",
        name: "coolant passage in the compressor housing",
        description: "a coolant passage from the compressor housing to water at 85 degC",
        equation: "G (358.15 K - Tc) to the compressor housing",
        source: WITHHELD,
        submodel: Submodel::CompressorHousing,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.hook(self)
    }
}

impl Hooks for CoolantPassage {
    fn heat_to_compressor_w(&self, site: &Site<'_>) -> f64 {
        self.conductance_w_k * (WATER_K - site.state.tc_k)
    }
}
