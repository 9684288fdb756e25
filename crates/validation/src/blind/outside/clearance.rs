//! The clearance over the wheel grows with the housing's temperature.

use super::WITHHELD;
use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The clearance over the wheel grows with the housing's temperature.
    #[derive(Debug)]
    pub(super) struct Clearance {
        /// Loss of efficiency per 100 K, ratio.
        loss_ratio = "k" ["1"] -0.5 .. 0.5, neutral 0.0, step 0.06;
    }
}

impl EffectKind for Clearance {
    const ABOUT: EffectText = EffectText {
        id: "X_clearance",
        name: "clearance that grows with heat",
        description: "a clearance that grows as the compressor housing gets hotter than 320 K",
        equation: "eta (1 - k (Tc - 320 K)/100 K)",
        source: WITHHELD,
        submodel: Submodel::CompressorGas,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.hook(self)
    }
}

impl Hooks for Clearance {
    fn efficiency(&self, site: &Site<'_>, efficiency: f64) -> f64 {
        efficiency * (1.0 - self.loss_ratio * (site.state.tc_k - 320.0) / 100.0)
    }
}
