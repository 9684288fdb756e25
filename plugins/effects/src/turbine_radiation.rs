//! The turbine housing shines on the compressor housing.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "turbine_radiation",
        "the turbine housing radiates to the compressor housing",
        "Q = FA sigma (Tt^4 - Tc^4)",
        "two-surface exchange: Incropera, 13.2",
        Submodel::TurbineHousing,
        vec![parameter("turbine_radiation", "m2", [0.0, 0.1], 0.0, 0.01)],
        |values, rig| rig.model.params.radiation_area_m2 += values[0],
    )
}
