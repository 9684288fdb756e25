//! The turbine gives more or less of its power.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "turbine_efficiency",
        "the turbine's efficiency is higher or lower everywhere",
        "eta_t = s eta_t,nominal",
        "worn or fouled turbine",
        Submodel::Shaft,
        vec![parameter("turbine_efficiency", "1", [0.5, 1.3], 1.0, -0.04)],
        |values, rig| rig.model.params.turbine.peak_efficiency *= values[0],
    )
}
