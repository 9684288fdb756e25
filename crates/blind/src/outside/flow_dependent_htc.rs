//! Convection depends on flow other than the correlation says.

use super::{Outside, hook};
use mapper_physics::effect::Submodel;
use mapper_physics::hooks::{Hooks, Site};

pub(super) fn effect() -> Outside {
    Outside::new(
        [
            "X_flow_dependent_htc",
            "the exponent of the flow in the convection is other than the correlation's",
            "h (m/0.06 kg/s)^e",
        ],
        Submodel::CompressorGas,
        ["e", "1"],
        [-1.0, 1.0, 0.0, 0.25],
        |value, rig| hook(rig, Taken(value)),
    )
}

/// Excess of the exponent.
#[derive(Debug)]
struct Taken(f64);

impl Hooks for Taken {
    fn h_w_m2k(&self, site: &Site<'_>, h_w_m2k: f64) -> f64 {
        h_w_m2k * (site.flow_kg_s / 0.06).powf(self.0)
    }
}
