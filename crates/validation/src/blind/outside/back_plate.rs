//! Heat goes from the bearing housing through the back plate into the compressed gas.

use super::WITHHELD;
use mapper_physics::effect_parameters;
use mapper_physics::gas::air;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// Heat goes from the bearing housing through the back plate into the compressed gas.
    #[derive(Debug)]
    pub(super) struct BackPlate {
        /// Conductance from the bearing side to the gas, W/K.
        conductance_w_k = "G" ["W/K"] 0.0 .. 5.0, neutral 0.0, step 0.5;
    }
}

impl EffectKind for BackPlate {
    const ABOUT: EffectText = EffectText {
        id: "X_back_plate",
        name: "heat through the back plate",
        description: "heat from the bearing side through the back plate into the gas behind the wheel",
        equation: "T2' rises by G (Tt - T2')/(m cp), taken from the turbine housing",
        source: WITHHELD,
        submodel: Submodel::CompressorGas,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.hook(self)
    }
}

impl Hooks for BackPlate {
    fn gas_after_k(&self, site: &Site<'_>, t2_prime_k: f64) -> f64 {
        // As eq. 3, so that the gas never passes the metal's temperature.
        let transfer_units = self.conductance_w_k / (site.flow_kg_s * air::heat_capacity_j_kgk(t2_prime_k));
        (t2_prime_k + transfer_units * site.state.tt_k) / (1.0 + transfer_units)
    }

    fn heat_to_turbine_w(&self, site: &Site<'_>) -> f64 {
        // Behind the plate already: T2' as the hook above left it.
        self.conductance_w_k * (site.t2_prime_k - site.state.tt_k)
    }
}
