//! Air moves in the cell.

use mapper_physics::effect;

effect! {
    pub(crate) struct Ventilation "ventilation";
    name: "air around the housings",
    description: "air moves around the housings: convection to the cell is stronger or weaker",
    equation: "Q_ext = A_ext (s 1.25 |T - T_amb|^(1/3) (T - T_amb) + eps sigma (T^4 - T_amb^4)), both housings",
    source: "Burke et al., Appendix A, external convection",
    submodel: TurbineHousing, also_shows_in: [CompressorHousing];
    /// Convection to the cell over the nominal one.
    convection_ratio = "ventilation" ["1"] 0.1 .. 5.0, neutral 1.0, step 0.6;
    |effect, rig| rig.model.params.external_convection_ratio *= effect.convection_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    /// By hand: 1.25 A |dT|^(4/3) more for each housing at twice the convection; radiation does not change.
    #[test]
    fn convection_to_the_cell_is_multiplied_and_radiation_is_not() {
        let (nominal, windy) = (Instant::nominal(), Instant::with(Ventilation { convection_ratio: 2.0 }));
        let more_w = |area_m2: f64, wall_k: f64| 1.25 * area_m2 * (wall_k - 298.15).powf(4.0 / 3.0);
        for (found_w, expected_w) in [
            (
                windy.outputs.compressor_external_heat_w - nominal.outputs.compressor_external_heat_w,
                more_w(79e-3, nominal.state.tc_k),
            ),
            (
                windy.outputs.turbine_external_heat_w - nominal.outputs.turbine_external_heat_w,
                more_w(80e-3, nominal.state.tt_k),
            ),
        ] {
            assert!((found_w - expected_w).abs() < 1e-9, "{found_w} W, {expected_w} W");
        }
    }
}
