//! The T2 probe has a tip of its own mass.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "tip_diameter",
        "the T2 probe's tip has a mass and follows the gas with a lag",
        "dT_tip/dt = (T2 - T_tip)/tau, tau = rho c d^2/(6 Nu k)",
        "Burke et al., eqs. 11 and 12",
        Submodel::T2Probe,
        vec![parameter("tip_diameter", "m", [0.0, 0.006], 0.0, 0.0015)],
        |values, rig| rig.model.params.t2_probe_diameter_m += values[0],
    )
}
