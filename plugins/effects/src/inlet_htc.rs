//! The heat transfer coefficient before the wheel differs from that after it.

use mapper_physics::effect;

effect! {
    pub(crate) struct InletHtc "inlet_htc";
    name: "convection before the wheel",
    description: "convection before the wheel differs from that after it, as in an inlet of another diameter; shows only where alpha_A is above 0",
    equation: "q1 = s h alpha_A A_c (T1 - Tc); by the law of the inlet's own diameter s is about (d_out/d_in)^(1 + b)",
    source: "Burke et al., section 5.2 and Appendix A (inlet diameter)",
    submodel: CompressorGas, also_shows_in: [CompressorHousing];
    /// h before the wheel over that of the nominal model; Appendix A's 40 mm before 35 mm give 0.75.
    inlet_ratio = "inlet_htc" ["1"] 0.2 .. 3.0, neutral 1.0, step -0.25;
    |effect, rig| rig.model.params.compressor.inlet_h_ratio *= effect.inlet_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Instant, T1_K};

    /// Eq. 1: the temperature rise before the wheel is proportional to h there; without area there it has no effect.
    #[test]
    fn heat_before_the_wheel_is_multiplied_where_area_lies_there() {
        let at = |alpha_area_ratio: f64, inlet_ratio: f64| {
            let mut at = Instant::with(InletHtc { inlet_ratio });
            at.rig.model.params.compressor.alpha_area_ratio = alpha_area_ratio;
            at.evaluate();
            at.outputs
        };
        let rise_k = |inlet_ratio: f64| at(0.2, inlet_ratio).t1_prime_k - T1_K;
        assert!((rise_k(0.75) / rise_k(1.0) - 0.75).abs() < 1e-9);
        assert_eq!(at(0.2, 0.75).h_w_m2k, at(0.2, 1.0).h_w_m2k, "the reported h is that after the wheel");
        assert_eq!(at(0.0, 0.75), at(0.0, 1.0));
    }
}
