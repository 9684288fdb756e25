//! The oil removes more or less heat from the bearing housing.

use mapper_physics::effect;

effect! {
    pub(crate) struct OilScale "oil_scale";
    name: "heat to the oil",
    description: "the oil takes more or less heat from the bearing housing",
    equation: "G_oil = s G_oil,nominal",
    source: "flow and viscosity of the oil: Burke et al., Appendix A, bearing housing",
    submodel: TurbineHousing, also_shows_in: [CompressorHousing];
    /// Conductance to the oil over the nominal one.
    scale_ratio = "oil_scale" ["1"] 0.1 .. 5.0, neutral 1.0, step 0.4;
    |effect, rig| rig.model.params.bearing.oil_conductance_w_k *= effect.scale_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    /// The heat from both housings into the bearing node goes to the oil.
    #[test]
    fn the_bearing_node_balances_with_the_scaled_oil() {
        let at = Instant::with(OilScale { scale_ratio: 1.5 });
        let half_w_k = 2.0 * 47.5 * 7e-4 / 45e-3;
        let from_housings_w = half_w_k * (at.state.tc_k + at.state.tt_k - 2.0 * at.outputs.bearing_k);
        let to_oil_w = 1.5 * 8.0 * (at.outputs.bearing_k - at.boundary.oil_temperature_k);
        assert!((from_housings_w - to_oil_w).abs() < 1e-9 && to_oil_w > 0.0);
    }
}
