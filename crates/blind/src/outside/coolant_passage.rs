//! Water flows through the compressor housing.

use super::{Outside, hook};
use mapper_physics::effect::Submodel;
use mapper_physics::hooks::{Hooks, Site};

/// Temperature of the water, K.
const WATER_K: f64 = 358.15;

pub(super) fn effect() -> Outside {
    Outside::new(
        [
            "X_coolant_passage",
            "a coolant passage from the compressor housing to water at 85 degC",
            "G (358.15 K - Tc) to the compressor housing",
        ],
        Submodel::CompressorHousing,
        ["G", "W/K"],
        [0.0, 20.0, 0.0, 1.5],
        |value, rig| hook(rig, Taken(value)),
    )
}

/// Conductance to the water, W/K.
#[derive(Debug)]
struct Taken(f64);

impl Hooks for Taken {
    fn heat_to_compressor_w(&self, site: &Site<'_>) -> f64 {
        self.0 * (WATER_K - site.state.tc_k)
    }
}
