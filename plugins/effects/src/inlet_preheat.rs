//! The gas is heated between its probe and the wheel.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "inlet_preheat",
        "the housing heats the gas between the T1 probe and the wheel",
        "T1 rises by UA (Tc - T1)/(m cp); the housing gives UA (Tc - T1)",
        "inlet duct as a conductance",
        Submodel::CompressorGas,
        vec![parameter("inlet_preheat", "W/K", [0.0, 10.0], 0.0, 1.0)],
        |values, rig| rig.model.params.compressor.inlet_conductance_w_k += values[0],
    )
}
