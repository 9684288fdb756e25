//! Heat goes from the bearing housing through the back plate into the compressed gas.

use super::{Outside, hook};
use mapper_physics::air;
use mapper_physics::effect::Submodel;
use mapper_physics::hooks::{Hooks, Site};

pub(super) fn effect() -> Outside {
    Outside::new(
        [
            "X_back_plate",
            "heat from the bearing side through the back plate into the gas behind the wheel",
            "T2' rises by G (Tt - T2')/(m cp), taken from the turbine housing",
        ],
        Submodel::CompressorGas,
        ["G", "W/K"],
        [0.0, 5.0, 0.0, 0.5],
        |value, rig| hook(rig, Taken(value)),
    )
}

/// Conductance, W/K.
#[derive(Debug)]
struct Taken(f64);

impl Hooks for Taken {
    fn gas_after_k(&self, site: &Site<'_>, t2_prime_k: f64) -> f64 {
        // As eq. 3, so that the gas never passes the metal's temperature.
        let transfer_units = self.0 / (site.flow_kg_s * air::heat_capacity_j_kgk(t2_prime_k));
        (t2_prime_k + transfer_units * site.state.tt_k) / (1.0 + transfer_units)
    }

    fn heat_to_turbine_w(&self, site: &Site<'_>) -> f64 {
        // Behind the plate already: T2' as the hook above left it.
        self.0 * (site.t2_prime_k - site.state.tt_k)
    }
}
