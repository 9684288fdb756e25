//! The P2 sensor reads high or low.

use crate::catalogued::{Catalogued, parameter};
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "p2_offset",
        "the pressure sensor behind the compressor reads high or low",
        "P2_read = P2 + b",
        "calibration of the sensor",
        Submodel::P2Sensor,
        vec![parameter("p2_offset", "Pa", [-20000.0, 20000.0], 0.0, 800.0)],
        |values, rig| rig.instruments.path_mut(Channel::P2).offset += values[0],
    )
}
