//! The speed pick-up reads high or low.

use super::{Outside, hook};
use mapper_core::Channel;
use mapper_physics::effect::Submodel;
use mapper_physics::hooks::{Hooks, Site};

pub(super) fn effect() -> Outside {
    Outside::new(
        ["X_speed_gain", "the speed sensor reads high or low in proportion", "N_read = (1 + g) N"],
        Submodel::Shaft,
        ["g", "1"],
        [-0.1, 0.1, 0.0, 0.01],
        |value, rig| hook(rig, Taken(value)),
    )
}

/// Error of the gain.
#[derive(Debug)]
struct Taken(f64);

impl Hooks for Taken {
    fn reading(&self, _site: &Site<'_>, channel: Channel, value: f64) -> f64 {
        if channel == Channel::ShaftSpeed { value * (1.0 + self.0) } else { value }
    }
}
