//! The inner wall of the compressor housing has its own temperature.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

/// At a fixed G the effect does not vanish as phi goes to 0 (the wall keeps the resistance 1/G): it vanishes as 1/G does.
/// phi = 0 itself is one node.
pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "inner_node",
        "the inner wall of the compressor housing has its own temperature",
        "phi M c dT_i/dt = q1 + q2 - G (T_i - Tc), (1 - phi) M c dTc/dt = G (T_i - Tc) + bearing - outside",
        "two-node wall",
        Submodel::CompressorHousing,
        vec![parameter("phi", "1", [0.0, 0.9], 0.0, 0.3), parameter("G", "W/K", [1.0, 500.0], 500.0, -480.0)],
        |values, rig| {
            if values[0] > 0.0 {
                rig.model.params.compressor.inner_capacity_ratio = values[0];
                rig.model.params.compressor.inner_conductance_w_k = values[1];
            }
        },
    )
}
