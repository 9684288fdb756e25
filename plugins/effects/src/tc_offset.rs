//! The probe in the housing reads high or low.

use crate::catalogued::{Catalogued, parameter};
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "tc_offset",
        "the probe in the compressor housing reads high or low",
        "Tc_read = Tc + b",
        "calibration or place of the probe",
        Submodel::TcProbe,
        vec![parameter("tc_offset", "K", [-30.0, 30.0], 0.0, 2.0)],
        |values, rig| rig.instruments.path_mut(Channel::Tc).offset += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_shifted() {
        let shifted = Instant::with(&effect(), &[2.0]).reading(Channel::Tc);
        assert!((shifted - Instant::nominal().reading(Channel::Tc) - 2.0).abs() < 1e-9);
    }
}
