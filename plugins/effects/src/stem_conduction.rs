//! The stem of the T2 probe conducts heat from the housing.

use mapper_physics::effect::{Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;

effect_parameters! {
    /// The stem of the T2 probe conducts heat from the housing.
    #[derive(Debug)]
    pub(crate) struct StemConduction {
        /// Share chi of the way from gas to housing.
        stem_ratio = "stem_conduction" ["1"] 0.0 .. 0.5, neutral 0.0, step 0.05;
    }
}

impl EffectKind for StemConduction {
    const ABOUT: About = About {
        id: "stem_conduction",
        name: "conduction along the T2 probe",
        description: "the T2 probe's stem conducts: the tip is drawn towards the housing",
        equation: "T_tip tends to T2 + chi (Tc - T2)",
        source: "fin of a thermowell, lumped to its tip: Incropera, Fundamentals of Heat and Mass Transfer, 3.6",
        submodel: Submodel::T2Probe,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.model.params.t2_probe_stem_ratio += self.stem_ratio;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_moves_its_share_of_the_way_to_the_housing() {
        let at = Instant::with(StemConduction { stem_ratio: 0.1 });
        let expected_k = 0.9 * at.outputs.t2_k + 0.1 * at.state.tc_k;
        assert!((at.outputs.t2_probe_k - expected_k).abs() < 1e-9);
        assert_eq!(at.outputs.t2_k, Instant::nominal().outputs.t2_k);
    }
}
