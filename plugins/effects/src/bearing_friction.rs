//! Additional friction power in the bearings.

use mapper_physics::effect;

effect! {
    pub(crate) struct BearingFriction "bearing_friction";
    name: "bearing friction",
    description: "the bearings take power from the shaft",
    equation: "I omega domega/dt = W_t - W_c - c omega^2",
    source: "viscous friction of journal bearings (Petroff)",
    submodel: Shaft, also_shows_in: [];
    /// Friction c of c omega^2, W s^2/rad^2.
    friction_w_s2 = "bearing_friction" ["W s2/rad2"] 0.0 .. 2e-05, neutral 0.0, step 1.5e-06;
    |effect, rig| rig.model.params.bearing_friction_w_s2 += effect.friction_w_s2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    /// 1.5e-6 (110e3 pi/30)^2 = 199.04 W.
    #[test]
    fn power_goes_with_the_square_of_speed() {
        let at = Instant::with(BearingFriction { friction_w_s2: 1.5e-6 });
        assert!((at.outputs.friction_power_w - 199.04).abs() < 0.01, "{}", at.outputs.friction_power_w);
        let balance_w = |at: &Instant| at.rig.model.prepare(&at.boundary).shaft_balance_w(&at.outputs);
        assert!((balance_w(&Instant::nominal()) - balance_w(&at) - 199.04).abs() < 0.01);
    }
}
