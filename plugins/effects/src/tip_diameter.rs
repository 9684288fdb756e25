//! The tip of the T2 probe has its own thermal mass.

use mapper_physics::effect;

effect! {
    pub(crate) struct TipDiameter "tip_diameter";
    name: "slow T2 probe",
    description: "the T2 probe's tip has a mass and follows the gas with a lag",
    equation: "dT_tip/dt = (T2 - T_tip)/tau, tau = rho c d^2/(6 Nu k)",
    source: "Burke et al., eqs. 11 and 12",
    submodel: T2Probe, also_shows_in: [];
    /// Diameter of the tip, m.
    diameter_m = "tip_diameter" ["m"] 0.0 .. 0.006, neutral 0.0, step 0.0015;
    |effect, rig| rig.model.params.t2_probe_diameter_m += effect.diameter_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;
    use mapper_physics::simulation::model::State;
    use mapper_physics::simulation::simulate::{Simulator, Watch};
    use mapper_physics::simulation::steady;

    /// A deviation of the tip by 10 K is 10/e K after its own time constant: nothing in the machine depends on it.
    #[test]
    fn the_tip_forgets_within_its_time_constant() {
        let mut at = Instant::with(TipDiameter { diameter_m: 3e-3 });
        let rest = steady::hold_speed(&at.rig.model, 110e3, &at.boundary).unwrap();
        let tau_s = rest.outputs.t2_probe_time_constant_s;
        at.state = State { t2_tip_k: rest.outputs.t2_k + 10.0, ..rest.state };
        let mut simulator = Simulator::new(&at.rig.model, 0.0, at.state, 1e-9, Watch::default());
        simulator.run_to(tau_s, &rest.boundary, [], |_, _, _| {}, |_| {}).unwrap();
        let off_k = simulator.state().t2_tip_k - rest.outputs.t2_k;
        // The integration is accurate to 1e-9 of 300 K.
        assert!((off_k - 10.0 / std::f64::consts::E).abs() < 1e-4, "{off_k} K after {tau_s} s");
        assert!(tau_s > 1.0 && tau_s < 12.0);
    }
}
