//! Lag of P3 behind its command.

use mapper_physics::effect;
use mapper_physics::rig::instruments::NOMINAL_P3_LAG_S;

effect! {
    pub(crate) struct ActuatorLag "actuator_lag";
    name: "slow P3 actuator",
    description: "the turbine inlet pressure follows its command more slowly or faster",
    equation: "dP3/dt = (P3_command - P3)/tau",
    source: "first-order actuator",
    submodel: Actuator, also_shows_in: [];
    /// Time constant of the lag, s.
    lag_s = "actuator_lag" ["s"] 0.0 .. 10.0, neutral 0.3, step 0.7;
    |effect, rig| rig.instruments.p3_lag_s += effect.lag_s - NOMINAL_P3_LAG_S
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_lag_is_the_one_asked_for() {
        assert!((Instant::with(ActuatorLag { lag_s: 1.2 }).rig.instruments.p3_lag_s - 1.2).abs() < 1e-12);
        assert_eq!(Instant::nominal().rig.instruments.p3_lag_s, 0.3);
    }
}
