//! The duct between compressor and T2 probe has its own mass.

use super::WITHHELD;
use mapper_physics::effect_parameters;
use mapper_physics::gas::air;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

/// Heat capacity of the duct, J/K.
const DUCT_J_K: f64 = 250.0;
/// Conductance from the duct to the cell, W/K.
const TO_CELL_W_K: f64 = 1.0;

effect_parameters! {
    /// The duct between compressor and T2 probe has its own mass.
    #[derive(Debug)]
    pub(super) struct OutletDuct {
        /// Conductance from gas to duct, W/K.
        conductance_w_k = "UA" ["W/K"] 0.0 .. 60.0, neutral 0.0, step 8.0;
    }
}

impl EffectKind for OutletDuct {
    const ABOUT: EffectText = EffectText {
        id: "X_outlet_duct",
        name: "outlet duct with its own mass",
        description: "an outlet duct with a mass of its own before the T2 probe",
        equation: "T2 leaves a duct of 250 J/K at T_d + (T2 - T_d) exp(-UA/(m cp)); 1 W/K of it to the cell",
        source: WITHHELD,
        submodel: Submodel::CompressorGas,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.hook(self)
    }
}

impl Hooks for OutletDuct {
    fn gas_outlet_k(&self, site: &Site<'_>, t2_k: f64) -> f64 {
        let capacity_w_k = site.flow_kg_s * air::heat_capacity_j_kgk(t2_k);
        let duct_k = site.extra_k.first().copied().unwrap_or(t2_k);
        duct_k + (t2_k - duct_k) * (-self.conductance_w_k / capacity_w_k).exp()
    }

    fn extra_states(&self) -> usize {
        1
    }

    fn extra_rates_k_s(&self, site: &Site<'_>, rates: &mut [f64]) {
        // The gas behind the duct is known here; what it brought follows from the same exponential.
        let (Some(rate), Some(duct_k)) = (rates.first_mut(), site.extra_k.first()) else { return };
        let capacity_w_k = site.flow_kg_s * air::heat_capacity_j_kgk(site.t2_k);
        let given_w = capacity_w_k * (site.t2_k - duct_k) * (self.conductance_w_k / capacity_w_k).exp_m1();
        let lost_w = TO_CELL_W_K * (duct_k - site.boundary.ambient_temperature_k);
        *rate = (given_w - lost_w) / DUCT_J_K;
    }
}
