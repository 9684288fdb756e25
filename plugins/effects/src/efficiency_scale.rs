//! The compressor's efficiency is higher or lower.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "efficiency_scale",
        "the compressor's efficiency is higher or lower everywhere",
        "eta = s eta_nominal",
        "worn or fouled compressor",
        Submodel::CompressorGas,
        vec![parameter("efficiency_scale", "1", [0.7, 1.3], 1.0, -0.02)],
        |values, rig| rig.model.params.compressor.efficiency_scale_ratio *= values[0],
    )
}
