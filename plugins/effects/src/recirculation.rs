//! Gas goes in a circle through the wheel.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "recirculation",
        "part of the flow comes back, hot, from behind the wheel to its inlet",
        "the wheel pumps (1 + r) m, the map's flow; T2' = T1' (1 + X)/(1 - r X), X = (PR^kappa - 1)/eta",
        "mixing balance of a ported shroud or backflow",
        Submodel::CompressorFlow,
        vec![parameter("recirculation", "1", [0.0, 0.3], 0.0, 0.03)],
        |values, rig| rig.model.params.compressor.recirculation_ratio += values[0],
    )
}
