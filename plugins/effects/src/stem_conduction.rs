//! The stem of the T2 probe conducts heat from the housing.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "stem_conduction",
        "the T2 probe's stem conducts: the tip is drawn towards the housing",
        "T_tip tends to T2 + chi (Tc - T2)",
        "fin of a thermowell, lumped to its tip: Incropera, Fundamentals of Heat and Mass Transfer, 3.6",
        Submodel::T2Probe,
        vec![parameter("stem_conduction", "1", [0.0, 0.5], 0.0, 0.05)],
        |values, rig| rig.model.params.t2_probe_stem_ratio += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_reading_moves_its_share_of_the_way_to_the_housing() {
        let at = Instant::with(&effect(), &[0.1]);
        let expected_k = 0.9 * at.outputs.t2_k + 0.1 * at.state.tc_k;
        assert!((at.outputs.t2_probe_k - expected_k).abs() < 1e-9);
        assert_eq!(at.outputs.t2_k, Instant::nominal().outputs.t2_k);
    }
}
