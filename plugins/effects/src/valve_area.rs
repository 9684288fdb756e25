//! The back-pressure valve is wider or narrower.

use mapper_physics::effect;

effect! {
    pub(crate) struct ValveArea "valve_area";
    name: "valve area",
    description: "the area of the back-pressure valve differs from that of its opening",
    equation: "CdA = s CdA,nominal",
    source: "calibration of the valve",
    submodel: Outlet, also_shows_in: [];
    /// Area of the valve over the nominal one.
    scale_ratio = "valve_area" ["1"] 0.7 .. 1.4, neutral 1.0, step 0.04;
    |effect, rig| rig.model.params.outlet.valve_area_m2 *= effect.scale_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_valve_passes_in_proportion() {
        let flow_kg_s = |at: Instant| at.outputs.valve_flow_kg_s;
        let ratio = flow_kg_s(Instant::with(ValveArea { scale_ratio: 1.05 })) / flow_kg_s(Instant::nominal());
        assert!((ratio - 1.05).abs() < 1e-12);
    }
}
