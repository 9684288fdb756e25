//! The back-pressure valve is wider or narrower.

use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::TooManyExtraStates;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The back-pressure valve is wider or narrower.
    #[derive(Debug)]
    pub(crate) struct ValveArea {
        /// Area of the valve over the nominal one.
        scale_ratio = "valve_area" ["1"] 0.7 .. 1.4, neutral 1.0, step 0.04;
    }
}

impl EffectKind for ValveArea {
    const ABOUT: EffectText = EffectText {
        id: "valve_area",
        name: "valve area",
        description: "the back-pressure valve is wider or narrower than its opening says",
        equation: "CdA = s CdA,nominal",
        source: "calibration of the valve",
        submodel: Submodel::Outlet,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.model.params.outlet.valve_area_m2 *= self.scale_ratio;
        Ok(())
    }
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
