//! The T2 probe does not recover the whole total temperature.

use mapper_physics::effect;

effect! {
    pub(crate) struct Recovery "recovery";
    name: "recovery of the T2 probe",
    description: "the T2 probe recovers only part of the gas's kinetic energy",
    equation: "T_tip tends to T2 - (1 - r) v^2/(2 cp), v = m/(rho A) in the outlet pipe",
    source: "recovery factor of a probe: Moffat, Gas temperature measurement (1962)",
    submodel: T2Probe, also_shows_in: [];
    /// Recovery factor r of the probe.
    recovery_ratio = "recovery" ["1"] 0.0 .. 1.5, neutral 1.0, step -0.3;
    |effect, rig| rig.model.params.t2_probe_recovery_ratio += effect.recovery_ratio - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    /// Without recovery the probe reads v^2/(2 cp) too low, v from the continuity of an ideal gas in a pipe of 35 mm.
    #[test]
    fn a_probe_without_recovery_reads_the_static_temperature() {
        let at = Instant::with(Recovery { recovery_ratio: 0.0 });
        let density_kg_m3 = at.state.p2_pa / (287.05 * at.outputs.t2_k);
        let velocity_m_s =
            at.outputs.flow_kg_s / (density_kg_m3 * std::f64::consts::PI / 4.0 * 0.035 * 0.035);
        let cp = 1002.5 + 275e-6 * (at.outputs.t2_k - 200.0).powi(2);
        let missing_k = velocity_m_s * velocity_m_s / (2.0 * cp);
        assert!((at.outputs.t2_k - at.outputs.t2_probe_k - missing_k).abs() < 1e-9 && missing_k > 0.1);
    }
}
