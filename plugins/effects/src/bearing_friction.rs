//! Bearings take power.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "bearing_friction",
        "the bearings take power from the shaft",
        "I omega domega/dt = W_t - W_c - c omega^2",
        "viscous friction of journal bearings (Petroff)",
        Submodel::Shaft,
        vec![parameter("bearing_friction", "W s2/rad2", [0.0, 2e-05], 0.0, 1.5e-06)],
        |values, rig| rig.model.params.bearing_friction_w_s2 += values[0],
    )
}
