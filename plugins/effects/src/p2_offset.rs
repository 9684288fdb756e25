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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_is_shifted() {
        let shifted = Instant::with(&effect(), &[-700.0]).reading(Channel::P2);
        assert!((shifted - Instant::nominal().reading(Channel::P2) - -700.0).abs() < 1e-9);
    }
}
