//! Oil takes more or less heat from the bearing housing.

use crate::catalogued::{Catalogued, parameter};
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "oil_scale",
        "the oil takes more or less heat from the bearing housing",
        "G_oil = s G_oil,nominal",
        "flow and viscosity of the oil: Burke et al., Appendix A, bearing housing",
        Submodel::TurbineHousing,
        vec![parameter("oil_scale", "1", [0.1, 5.0], 1.0, 0.4)],
        |values, rig| rig.model.params.bearing.oil_conductance_w_k *= values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    /// What flows to the bearing node from both housings goes to the oil.
    #[test]
    fn the_bearing_node_balances_with_the_scaled_oil() {
        let at = Instant::with(&effect(), &[1.5]);
        let half_w_k = 2.0 * 47.5 * 7e-4 / 45e-3;
        let from_housings_w = half_w_k * (at.state.tc_k + at.state.tt_k - 2.0 * at.outputs.bearing_k);
        let to_oil_w = 1.5 * 8.0 * (at.outputs.bearing_k - at.boundary.oil_temperature_k);
        assert!((from_housings_w - to_oil_w).abs() < 1e-9 && to_oil_w > 0.0);
    }
}
