//! The back-pressure valve is wider or narrower.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "valve_area",
        "the back-pressure valve is wider or narrower than its opening says",
        "CdA = s CdA,nominal",
        "calibration of the valve",
        Submodel::Outlet,
        vec![parameter("valve_area", "1", [0.7, 1.4], 1.0, 0.04)],
        |values, rig| rig.model.params.outlet.valve_area_m2 *= values[0],
    )
}
