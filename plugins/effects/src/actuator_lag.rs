//! P3 follows its command more slowly.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;
use mapper_physics::instruments::NOMINAL_P3_LAG_S;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "actuator_lag",
        "the turbine inlet pressure follows its command more slowly or faster",
        "dP3/dt = (P3_command - P3)/tau",
        "first-order actuator",
        Submodel::Actuator,
        vec![parameter("actuator_lag", "s", [0.0, 10.0], 0.3, 0.7)],
        |values, rig| rig.instruments.p3_lag_s += values[0] - NOMINAL_P3_LAG_S,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn the_lag_is_the_one_asked_for() {
        assert!((Instant::with(&effect(), &[1.2]).rig.instruments.p3_lag_s - 1.2).abs() < 1e-12);
        assert_eq!(Instant::nominal().rig.instruments.p3_lag_s, 0.3);
    }
}
