//! The probe in the housing is slow.

use super::Outside;
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(super) fn effect() -> Outside {
    Outside::new(
        [
            "X_slow_housing_probe",
            "a slow probe in the compressor housing",
            "dTc_read/dt = (Tc - Tc_read)/tau",
        ],
        Submodel::TcProbe,
        ["tau", "s"],
        [0.0, 120.0, 0.0, 12.0],
        |value, rig| {
            rig.instruments.path_mut(Channel::Tc).lag_s += value;
            Ok(())
        },
    )
}
