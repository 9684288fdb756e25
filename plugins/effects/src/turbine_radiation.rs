//! The turbine housing shines on the compressor housing.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "turbine_radiation",
        "the turbine housing radiates to the compressor housing",
        "Q = FA sigma (Tt^4 - Tc^4)",
        "two-surface exchange: Incropera, 13.2",
        Submodel::TurbineHousing,
        vec![parameter("turbine_radiation", "m2", [0.0, 0.1], 0.0, 0.01)],
        |values, rig| rig.model.params.radiation_area_m2 += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    /// 0.01 m2 between 500 K and 340 K: 5.670374e-10 (500^4 - 340^4) = 27.863 W, out of one housing into the other.
    #[test]
    fn heat_leaves_one_housing_and_enters_the_other() {
        let balances = |at: &Instant| {
            let prepared = at.rig.model.prepare(&at.boundary);
            [
                prepared.compressor_housing_balance_w(&at.state, &at.outputs),
                prepared.turbine_housing_balance_w(&at.state, &at.outputs),
            ]
        };
        let (dark, shining) = (balances(&Instant::nominal()), balances(&Instant::with(&effect(), &[0.01])));
        for (found_w, expected_w) in [(shining[0] - dark[0], 27.863), (shining[1] - dark[1], -27.863)] {
            assert!((found_w - expected_w).abs() < 1e-3, "{found_w} W");
        }
    }
}
