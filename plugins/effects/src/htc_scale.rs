//! All convection of the compressor housing is stronger or weaker.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "htc_scale",
        "convection between gas and compressor housing is stronger or weaker everywhere",
        "h = s h_nominal",
        "Burke et al., eq. 9: its coefficient a",
        Submodel::CompressorGas,
        vec![parameter("htc_scale", "1", [0.3, 3.0], 1.0, 0.2)],
        |values, rig| rig.model.params.compressor.nusselt_coefficient *= values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn h_is_multiplied() {
        let ratio = Instant::with(&effect(), &[1.2]).outputs.h_w_m2k / Instant::nominal().outputs.h_w_m2k;
        assert!((ratio - 1.2).abs() < 1e-12);
    }
}
