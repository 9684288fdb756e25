//! The shaft rubs with a torque that does not depend on speed.

use super::{Outside, hook};
use mapper_physics::effect::Submodel;
use mapper_physics::hooks::{Hooks, Site};

pub(super) fn effect() -> Outside {
    Outside::new(
        ["X_coulomb_friction", "the shaft rubs with a constant torque", "-M on the shaft"],
        Submodel::Shaft,
        ["M", "N m"],
        [0.0, 0.2, 0.0, 0.012],
        |value, rig| hook(rig, Taken(value)),
    )
}

/// Torque, N m.
#[derive(Debug)]
struct Taken(f64);

impl Hooks for Taken {
    fn shaft_torque_nm(&self, _site: &Site<'_>) -> f64 {
        -self.0
    }
}
