//! A long thin line delays the P2 sensor.

use super::Outside;
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(super) fn effect() -> Outside {
    Outside::new(
        ["X_slow_pressure_line", "a slow pressure line to the P2 sensor", "dP2_read/dt = (P2 - P2_read)/tau"],
        Submodel::P2Sensor,
        ["tau", "s"],
        [0.0, 60.0, 0.0, 4.0],
        |value, rig| {
            rig.instruments.path_mut(Channel::P2).lag_s += value;
            Ok(())
        },
    )
}
