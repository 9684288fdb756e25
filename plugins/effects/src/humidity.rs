//! The compressor breathes moist air.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "humidity",
        "the compressor breathes moist air",
        "R (1 + 0.6078 w), cp (1 + 0.84 w), flow times sqrt(287.05/R) on the compressor side",
        "mixture of ideal gases; cp of vapour 1850 J/(kg K)",
        Submodel::CompressorFlow,
        vec![parameter("humidity", "kg/kg", [0.0, 0.06], 0.0, 0.012)],
        |values, rig| rig.model.params.compressor.humidity_kg_kg += values[0],
    )
}
