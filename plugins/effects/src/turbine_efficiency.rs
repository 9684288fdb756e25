//! The turbine gives more or less of its power.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "turbine_efficiency",
        "the turbine's efficiency is higher or lower everywhere",
        "eta_t = s eta_t,nominal",
        "worn or fouled turbine",
        Submodel::Shaft,
        vec![parameter("turbine_efficiency", "1", [0.5, 1.3], 1.0, -0.04)],
        |values, rig| rig.model.params.turbine.peak_efficiency *= values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_drop_over_the_wheel_is_multiplied() {
        let drop_k = |at: Instant| at.outputs.turbine.t3_prime_k - at.outputs.turbine.t4_k;
        let ratio = drop_k(Instant::with(&effect(), &[0.96])) / drop_k(Instant::nominal());
        assert!((ratio - 0.96).abs() < 1e-12);
    }
}
