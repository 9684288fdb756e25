//! The compressor moves more or less.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "flow_map_scale",
        "the compressor moves more or less at equal speed and pressure ratio",
        "m_corr = s m_corr,nominal; the efficiency stays where it is on the speed line",
        "worn or fouled compressor, other trim",
        Submodel::CompressorFlow,
        vec![parameter("flow_map_scale", "1", [0.7, 1.3], 1.0, 0.03)],
        |values, rig| rig.model.params.compressor.flow_scale_ratio *= values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn flow_is_multiplied_at_equal_efficiency() {
        let (nominal, other) = (Instant::nominal().outputs, Instant::with(&effect(), &[1.03]).outputs);
        assert!((other.flow_kg_s / nominal.flow_kg_s - 1.03).abs() < 1e-12);
        assert_eq!(other.efficiency, nominal.efficiency);
    }
}
