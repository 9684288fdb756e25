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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_multiplied_and_the_flow_is_not() {
        let at = Instant::with(&effect(), &[1.03]);
        assert!((at.reading(Channel::CompressorFlow) / at.outputs.flow_kg_s - 1.03).abs() < 1e-12);
        assert_eq!(at.outputs.flow_kg_s, Instant::nominal().outputs.flow_kg_s);
    }
}
