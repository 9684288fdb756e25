//! One instant of the machine with an effect, for tests with known results.

use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{EffectKind, Rig};
use mapper_physics::simulation::model::{Model, Outputs, State, rad_s_of_rpm};

/// Inlet temperature of the instant, K.
pub(crate) const T1_K: f64 = 298.15;
/// Heat capacity of dry air there by the model's closed form, J/(kg K).
pub(crate) const CP1_J_KGK: f64 = 1002.5 + 275e-6 * 98.15 * 98.15;

/// A machine at 110 krpm and pressure ratio 1.55, its housings at 340 K and 500 K.
pub(crate) struct Instant {
    pub(crate) rig: Rig,
    pub(crate) boundary: BoundaryConditions,
    pub(crate) state: State,
    pub(crate) outputs: Outputs,
}

impl Instant {
    pub(crate) fn nominal() -> Self {
        Self::of(Rig::new(Model::nominal()))
    }

    pub(crate) fn with(effect: impl EffectKind) -> Self {
        let mut rig = Rig::new(Model::nominal());
        effect.put_into(&mut rig).unwrap();
        Self::of(rig)
    }

    fn of(rig: Rig) -> Self {
        let boundary = BoundaryConditions { p3_pa: 165e3, ..BoundaryConditions::default() };
        let state = State::new(rad_s_of_rpm(110e3), 155e3, 340.0, 500.0, 370.0);
        let outputs = rig.model.prepare(&boundary).evaluate(&state);
        Instant { rig, boundary, state, outputs }
    }

    /// Evaluates once more after a change of the state.
    pub(crate) fn evaluate(&mut self) {
        self.outputs = self.rig.model.prepare(&self.boundary).evaluate(&self.state);
    }
}
