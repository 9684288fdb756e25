//! The T1 probe reads high or low.

use crate::catalogued::{Catalogued, parameter};
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "t1_offset",
        "the probe before the compressor reads high or low",
        "T1_read = T1 + b",
        "calibration of the probe",
        Submodel::T1Probe,
        vec![parameter("t1_offset", "K", [-20.0, 20.0], 0.0, 1.5)],
        |values, rig| rig.instruments.path_mut(Channel::T1).offset += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_shifted() {
        let shifted = Instant::with(&effect(), &[0.8]).reading(Channel::T1);
        assert!((shifted - Instant::nominal().reading(Channel::T1) - 0.8).abs() < 1e-9);
    }
}
