//! The compressor's flow meter is slow.

use crate::catalogued::{Catalogued, parameter};
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "flowmeter_lag",
        "the compressor's flow meter follows the flow with a lag",
        "dm_read/dt = (m - m_read)/tau",
        "first-order meter",
        Submodel::FlowMeter,
        vec![parameter("flowmeter_lag", "s", [0.0, 30.0], 0.0, 2.0)],
        |values, rig| rig.instruments.path_mut(Channel::CompressorFlow).lag_s += values[0],
    )
}
