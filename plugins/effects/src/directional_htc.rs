//! Convection depends on the direction of the heat.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "directional_htc",
        "convection is other where the metal heats the gas than where the gas heats the metal",
        "h f where the metal is hotter than the gas it touches (T1 before, T2' after compression), h elsewhere",
        "wall-temperature dependence beyond the viscosity ratio: Sieder and Tate (1936)",
        Submodel::CompressorGas,
        vec![parameter("directional_htc", "1", [0.2, 3.0], 1.0, -0.3)],
        |values, rig| rig.model.params.compressor.hot_metal_h_ratio *= values[0],
    )
}
