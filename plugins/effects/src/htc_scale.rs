//! The convection of the compressor housing is stronger or weaker.

use mapper_physics::effect;

effect! {
    pub(crate) struct HtcScale "htc_scale";
    name: "convection in the compressor",
    description: "convection between gas and compressor housing is stronger or weaker everywhere",
    equation: "h = s h_nominal",
    source: "Burke et al., eq. 9: its coefficient a",
    submodel: CompressorGas, also_shows_in: [CompressorHousing];
    /// h over the correlation's.
    scale_ratio = "htc_scale" ["1"] 0.3 .. 3.0, neutral 1.0, step 0.2;
    |effect, rig| rig.model.params.compressor.nusselt_coefficient *= effect.scale_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn h_is_multiplied() {
        let ratio =
            Instant::with(HtcScale { scale_ratio: 1.2 }).outputs.h_w_m2k / Instant::nominal().outputs.h_w_m2k;
        assert!((ratio - 1.2).abs() < 1e-12);
    }
}
