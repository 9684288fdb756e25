//! The T2 probe reads high or low.

use crate::catalogued::{Catalogued, parameter};
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "t2_offset",
        "the probe behind the compressor reads high or low",
        "T2_read = T2 + b",
        "calibration of the probe",
        Submodel::T2Probe,
        vec![parameter("t2_offset", "K", [-20.0, 20.0], 0.0, 1.5)],
        |values, rig| rig.instruments.path_mut(Channel::T2).offset += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_shifted() {
        let shifted = Instant::with(&effect(), &[-1.5]).reading(Channel::T2);
        assert!((shifted - Instant::nominal().reading(Channel::T2) - -1.5).abs() < 1e-9);
    }
}
