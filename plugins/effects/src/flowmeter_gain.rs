//! The compressor's flow meter reads high or low.

use crate::catalogued::{Catalogued, parameter};
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "flowmeter_gain",
        "the compressor's flow meter reads high or low in proportion",
        "m_read = s m",
        "calibration of the meter",
        Submodel::FlowMeter,
        vec![parameter("flowmeter_gain", "1", [0.7, 1.3], 1.0, 0.03)],
        |values, rig| rig.instruments.path_mut(Channel::CompressorFlow).gain_ratio *= values[0],
    )
}
