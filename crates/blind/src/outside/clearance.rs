//! The clearance over the wheel grows with the housing's temperature.

use super::{Outside, hook};
use mapper_physics::effect::Submodel;
use mapper_physics::hooks::{Hooks, Site};

pub(super) fn effect() -> Outside {
    Outside::new(
        [
            "X_clearance",
            "a clearance that grows as the compressor housing gets hotter than 320 K",
            "eta (1 - k (Tc - 320 K)/100 K)",
        ],
        Submodel::CompressorGas,
        ["k", "1"],
        [-0.5, 0.5, 0.0, 0.06],
        |value, rig| hook(rig, Taken(value)),
    )
}

/// Loss of efficiency per 100 K.
#[derive(Debug)]
struct Taken(f64);

impl Hooks for Taken {
    fn efficiency(&self, site: &Site<'_>, efficiency: f64) -> f64 {
        efficiency * (1.0 - self.0 * (site.state.tc_k - 320.0) / 100.0)
    }
}
