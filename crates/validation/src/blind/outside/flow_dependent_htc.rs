//! Convection depends on flow otherwise than in the correlation.

use super::WITHHELD;
use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// Convection depends on flow otherwise than in the correlation.
    #[derive(Debug)]
    pub(super) struct FlowDependentHtc {
        /// Excess of the exponent.
        exponent = "e" ["1"] -1.0 .. 1.0, neutral 0.0, step 0.25;
    }
}

impl EffectKind for FlowDependentHtc {
    const ABOUT: EffectText = EffectText {
        id: "X_flow_dependent_htc",
        name: "other exponent of convection",
        description: "the exponent of the flow in the convection is other than the correlation's",
        equation: "h (m/0.06 kg/s)^e",
        source: WITHHELD,
        submodel: Submodel::CompressorGas,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.hook(self)
    }
}

impl Hooks for FlowDependentHtc {
    fn h_w_m2k(&self, site: &Site<'_>, h_w_m2k: f64) -> f64 {
        h_w_m2k * (site.flow_kg_s / 0.06).powf(self.exponent)
    }
}
