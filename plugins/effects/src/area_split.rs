//! Part of the heat enters the gas before the wheel.

use mapper_physics::effect;

effect! {
    pub(crate) struct AreaSplit "area_split";
    name: "area before the wheel",
    description: "part of the housing's internal area meets the gas before compression",
    equation: "q1 = h alpha_A A_c (T1 - Tc) before, q2 = h (1 - alpha_A) A_c (T2 - Tc) after compression",
    source: "Burke et al., eqs. 1 and 3",
    submodel: CompressorGas, also_shows_in: [CompressorHousing];
    /// Share alpha_A of the internal area that meets the gas before compression.
    before_ratio = "area_split" ["1"] 0.0 .. 0.6, neutral 0.0, step 0.1;
    |effect, rig| rig.model.params.compressor.alpha_area_ratio += effect.before_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{CP1_J_KGK, Instant, T1_K};

    /// Eq. 1 by hand: 12 % of 29e-3 m2, the housing 42 K warmer than the inlet.
    #[test]
    fn gas_before_the_wheel_takes_heat_from_its_share_of_the_area() {
        let (nominal, warm) = (Instant::nominal(), Instant::with(AreaSplit { before_ratio: 0.12 }));
        let heat_w = warm.outputs.h_w_m2k * 0.12 * 29e-3 * (warm.state.tc_k - T1_K);
        let rise_k = heat_w / (warm.outputs.flow_kg_s * CP1_J_KGK);
        assert!((warm.outputs.t1_prime_k - T1_K - rise_k).abs() < 1e-9, "{rise_k} K");
        assert_eq!(nominal.outputs.t1_prime_k, T1_K);
    }
}
