//! The T2 probe does not feel the whole total temperature.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "recovery",
        "the T2 probe recovers only part of the gas's kinetic energy",
        "T_tip tends to T2 - (1 - r) v^2/(2 cp), v = m/(rho A) in the outlet pipe",
        "recovery factor of a probe: Moffat, Gas temperature measurement (1962)",
        Submodel::T2Probe,
        vec![parameter("recovery", "1", [0.0, 1.5], 1.0, -0.3)],
        |values, rig| rig.model.params.t2_probe_recovery_ratio += values[0] - 1.0,
    )
}
