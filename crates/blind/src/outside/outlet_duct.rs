//! The duct between compressor and T2 probe has its own mass.

use super::{Outside, hook};
use mapper_physics::air;
use mapper_physics::effect::Submodel;
use mapper_physics::hooks::{Hooks, Site};

/// Heat capacity of the duct, J/K.
const DUCT_J_K: f64 = 250.0;
/// Conductance from the duct to the cell, W/K.
const TO_CELL_W_K: f64 = 1.0;

pub(super) fn effect() -> Outside {
    Outside::new(
        [
            "X_outlet_duct",
            "an outlet duct with a mass of its own before the T2 probe",
            "T2 leaves a duct of 250 J/K at T_d + (T2 - T_d) exp(-UA/(m cp)); 1 W/K of it to the cell",
        ],
        Submodel::CompressorGas,
        ["UA", "W/K"],
        [0.0, 60.0, 0.0, 8.0],
        |value, rig| hook(rig, Taken(value)),
    )
}

/// Conductance from gas to duct, W/K.
#[derive(Debug)]
struct Taken(f64);

impl Hooks for Taken {
    fn gas_outlet_k(&self, site: &Site<'_>, t2_k: f64) -> f64 {
        let capacity_w_k = site.flow_kg_s * air::heat_capacity_j_kgk(t2_k);
        let duct_k = site.extra_k.first().copied().unwrap_or(t2_k);
        duct_k + (t2_k - duct_k) * (-self.0 / capacity_w_k).exp()
    }

    fn extra_states(&self) -> usize {
        1
    }

    fn extra_rates_k_s(&self, site: &Site<'_>, rates: &mut [f64]) {
        // The gas behind the duct is known here; what it brought follows from the same exponential.
        let (Some(rate), Some(duct_k)) = (rates.first_mut(), site.extra_k.first()) else { return };
        let capacity_w_k = site.flow_kg_s * air::heat_capacity_j_kgk(site.t2_k);
        let given_w = capacity_w_k * (site.t2_k - duct_k) * (self.0 / capacity_w_k).exp_m1();
        let lost_w = TO_CELL_W_K * (duct_k - site.boundary.ambient_temperature_k);
        *rate = (given_w - lost_w) / DUCT_J_K;
    }
}
