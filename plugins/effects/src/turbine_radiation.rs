//! The turbine housing radiates to the compressor housing.

use mapper_physics::effect;

effect! {
    pub(crate) struct TurbineRadiation "turbine_radiation";
    name: "radiation between the housings",
    description: "the turbine housing radiates to the compressor housing",
    equation: "Q = FA sigma (Tt^4 - Tc^4)",
    source: "two-surface exchange: Incropera, 13.2",
    submodel: TurbineHousing, also_shows_in: [CompressorHousing];
    /// View factor times area FA, m2.
    view_area_m2 = "turbine_radiation" ["m2"] 0.0 .. 0.1, neutral 0.0, step 0.01;
    |effect, rig| rig.model.params.radiation_area_m2 += effect.view_area_m2
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
        let (dark, shining) = (
            balances(&Instant::nominal()),
            balances(&Instant::with(TurbineRadiation { view_area_m2: 0.01 })),
        );
        for (found_w, expected_w) in [(shining[0] - dark[0], 27.863), (shining[1] - dark[1], -27.863)] {
            assert!((found_w - expected_w).abs() < 1e-3, "{found_w} W");
        }
    }
}
