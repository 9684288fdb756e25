//! Bearings take power.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "bearing_friction",
        "the bearings take power from the shaft",
        "I omega domega/dt = W_t - W_c - c omega^2",
        "viscous friction of journal bearings (Petroff)",
        Submodel::Shaft,
        vec![parameter("bearing_friction", "W s2/rad2", [0.0, 2e-05], 0.0, 1.5e-06)],
        |values, rig| rig.model.params.bearing_friction_w_s2 += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    /// 1.5e-6 (110e3 pi/30)^2 = 199.04 W.
    #[test]
    fn power_goes_with_the_square_of_speed() {
        let at = Instant::with(&effect(), &[1.5e-6]);
        assert!((at.outputs.friction_power_w - 199.04).abs() < 0.01, "{}", at.outputs.friction_power_w);
        let balance_w = |at: &Instant| at.rig.model.prepare(&at.boundary).shaft_balance_w(&at.outputs);
        assert!((balance_w(&Instant::nominal()) - balance_w(&at) - 199.04).abs() < 0.01);
    }
}
