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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_valve_passes_in_proportion() {
        let flow_kg_s = |at: Instant| at.outputs.valve_flow_kg_s;
        let ratio = flow_kg_s(Instant::with(&effect(), &[1.05])) / flow_kg_s(Instant::nominal());
        assert!((ratio - 1.05).abs() < 1e-12);
    }
}
