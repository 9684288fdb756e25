//! Part of the heat goes to the gas before the wheel.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "area_split",
        "part of the housing's internal area meets the gas before compression",
        "q1 = h alpha_A A_c (T1 - Tc) before, q2 = h (1 - alpha_A) A_c (T2 - Tc) after compression",
        "Burke et al., eqs. 1 and 3",
        Submodel::CompressorGas,
        vec![parameter("area_split", "1", [0.0, 0.6], 0.0, 0.1)],
        |values, rig| rig.model.params.compressor.alpha_area_ratio += values[0],
    )
}
