//! What moves the machine while gas flows: the lumped model, or other equations under the same rig.

use super::inputs::LabInputs;
use super::name::NAME;
use mapper_physics::model::{Model, Outputs, State};
use mapper_physics::params::{BoundaryConditions, Params};
use mapper_physics::simulate::{DEFAULT_RELATIVE_TOLERANCE, ModelEvent, SimulationError, Simulator, Watch};
use mapper_physics::steady;

/// Why a machine cannot be settled.
pub type StructureError = Box<dyn std::error::Error + Send + Sync>;

/// A machine whose shaft turns: what the lab asks of it, whatever its equations are.
pub trait RunningMachine: std::fmt::Debug + Send {
    /// What the rig's sensors would call its state.
    fn state(&self) -> State;

    /// Forgets the step size; called after a jump of the inputs.
    fn restart(&mut self);

    /// Goes on as a machine of other parameters.
    fn change_params(&mut self, params: Params);

    /// Runs to `end_s`, with samples and events on the way, as [`Simulator::run_to`] does.
    ///
    /// # Errors
    /// [`SimulationError`] where the inputs have no meaning or the tolerance cannot be met.
    fn run_to(
        &mut self,
        end_s: f64,
        inputs: &LabInputs,
        sample_times_s: &mut dyn Iterator<Item = f64>,
        on_sample: &mut dyn FnMut(f64, &State, &Outputs),
        on_event: &mut dyn FnMut(ModelEvent),
    ) -> Result<(), SimulationError>;
}

/// Equations of a machine.
pub trait Structure: std::fmt::Debug + Send + Sync {
    /// Name under which campaigns ask for a lab of these equations.
    fn name(&self) -> &'static str;

    /// A machine that starts at `state` at `t_s`.
    fn started(&self, model: &Model, t_s: f64, state: State, watch: Watch) -> Box<dyn RunningMachine>;

    /// A machine that has stood under `boundary` for long.
    ///
    /// # Errors
    /// Where there is no state of rest, e.g. with too little air.
    fn settled(
        &self,
        model: &Model,
        t_s: f64,
        boundary: &BoundaryConditions,
        watch: Watch,
    ) -> Result<Box<dyn RunningMachine>, StructureError>;
}

/// The lumped model of Burke et al.
#[derive(Debug)]
pub struct Lumped;

impl Structure for Lumped {
    fn name(&self) -> &'static str {
        NAME
    }

    fn started(&self, model: &Model, t_s: f64, state: State, watch: Watch) -> Box<dyn RunningMachine> {
        Box::new(Simulator::new(model, t_s, state, DEFAULT_RELATIVE_TOLERANCE, watch))
    }

    fn settled(
        &self,
        model: &Model,
        t_s: f64,
        boundary: &BoundaryConditions,
        watch: Watch,
    ) -> Result<Box<dyn RunningMachine>, StructureError> {
        let rest = steady::settle_under(model, boundary)?;
        Ok(self.started(model, t_s, rest.state, watch))
    }
}

impl RunningMachine for Simulator {
    fn state(&self) -> State {
        Simulator::state(self)
    }

    fn restart(&mut self) {
        Simulator::restart(self);
    }

    fn change_params(&mut self, params: Params) {
        Simulator::change_params(self, params);
    }

    fn run_to(
        &mut self,
        end_s: f64,
        inputs: &LabInputs,
        sample_times_s: &mut dyn Iterator<Item = f64>,
        on_sample: &mut dyn FnMut(f64, &State, &Outputs),
        on_event: &mut dyn FnMut(ModelEvent),
    ) -> Result<(), SimulationError> {
        Simulator::run_to(self, end_s, inputs, sample_times_s, on_sample, on_event)
    }
}
