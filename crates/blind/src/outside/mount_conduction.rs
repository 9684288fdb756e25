//! The compressor housing stands on a cold mount.

use super::{Outside, hook};
use mapper_physics::effect::Submodel;
use mapper_physics::hooks::{Hooks, Site};

pub(super) fn effect() -> Outside {
    Outside::new(
        [
            "X_mount_conduction",
            "the compressor housing conducts to a mount at 20 degC",
            "G (293.15 K - Tc) to the compressor housing",
        ],
        Submodel::CompressorHousing,
        ["G", "W/K"],
        [0.0, 20.0, 0.0, 1.5],
        |value, rig| hook(rig, Taken(value)),
    )
}

/// Conductance to the mount, W/K.
#[derive(Debug)]
struct Taken(f64);

impl Hooks for Taken {
    fn heat_to_compressor_w(&self, site: &Site<'_>) -> f64 {
        self.0 * (293.15 - site.state.tc_k)
    }
}
