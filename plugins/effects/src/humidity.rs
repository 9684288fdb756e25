//! The compressor takes in moist air.

use mapper_physics::effect;

effect! {
    pub(crate) struct Humidity "humidity";
    name: "moist air",
    description: "the compressor takes in air with more water than declared",
    equation: "R (1 + 0.6078 w), cp (1 + 0.84 w), flow times sqrt(287.05/R) on the compressor side",
    source: "mixture of ideal gases; cp of vapour 1850 J/(kg K)",
    submodel: CompressorFlow, also_shows_in: [CompressorGas];
    /// Water per dry air in addition to the declared humidity, kg/kg.
    water_kg_kg = "humidity" ["kg/kg"] 0.0 .. 0.06, neutral 0.0, step 0.012;
    |effect, rig| rig.model.params.compressor.humidity_kg_kg += effect.water_kg_kg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{CP1_J_KGK, Instant, T1_K};
    use mapper_physics::simulation::model::Outputs;

    /// The mixture rules themselves, with R = 461.5 and cp = 1870 J/(kg K) of vapour at 320 K (IAPWS-95, ideal gas), per kg of moist air. The
    /// vapour's cp changes by 1 % over the compression, which is 1e-4 of the mixture's.
    #[test]
    fn constants_are_those_of_the_mixture_and_flow_falls() {
        let w = 0.01;
        let (nominal, moist) =
            (Instant::nominal().outputs, Instant::with(Humidity { water_kg_kg: w }).outputs);
        let gas_constant = (287.05 + w * 461.5) / (1.0 + w);
        let flow_ratio = moist.flow_kg_s / nominal.flow_kg_s;
        assert!((flow_ratio - (287.05 / gas_constant).sqrt()).abs() < 1e-4, "{flow_ratio}");
        // kappa = R/cp: ln(1 + rise) over ln PR.
        let kappa =
            |at: &Outputs| ((at.t2_prime_k / T1_K - 1.0) * at.efficiency).ln_1p() / at.pressure_ratio.ln();
        let cp_ratio = (1.0 + w * 1870.0 / CP1_J_KGK) / (1.0 + w);
        let expected = gas_constant / 287.05 / cp_ratio;
        assert!((kappa(&moist) / kappa(&nominal) - expected).abs() < 2e-4);
    }
}
