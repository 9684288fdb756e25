//! The running machine: the lumped model, or other equations in the same rig.

use crate::virtual_lab::name::NAME;
use crate::virtual_lab::rig::inputs::LabInputs;
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::model::{Model, Outputs, State};
use mapper_physics::simulation::simulate::{
    DEFAULT_RELATIVE_TOLERANCE, ModelEvent, SimulationError, Simulator, Watch,
};
use mapper_physics::simulation::steady;

/// Failure to find a steady state.
pub type StructureError = Box<dyn std::error::Error + Send + Sync>;

/// A running machine: the lab's interface to its equations.
pub trait RunningMachine: std::fmt::Debug + Send {
    /// State as the rig's sensors define it.
    fn state(&self) -> State;

    /// Resets the step size; called after a jump of the inputs.
    fn restart(&mut self);

    /// Continues with other machine parameters.
    fn change_params(&mut self, params: Params);

    /// Runs to `end_s`, with samples and events on the way, as [`Simulator::run_to`] does.
    ///
    /// # Errors
    /// [`SimulationError`] if the inputs are invalid or the tolerance cannot be met.
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
    /// Name of a lab with these equations in campaigns.
    fn name(&self) -> &'static str;

    /// A machine that starts at `state` at `t_s`.
    fn start(&self, model: &Model, t_s: f64, state: State, watch: Watch) -> Box<dyn RunningMachine>;

    /// A machine in steady state under `boundary`.
    ///
    /// # Errors
    /// If no steady state exists, e.g. with too little air.
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

    fn start(&self, model: &Model, t_s: f64, state: State, watch: Watch) -> Box<dyn RunningMachine> {
        Box::new(Simulator::new(model, t_s, state, DEFAULT_RELATIVE_TOLERANCE, watch))
    }

    fn settled(
        &self,
        model: &Model,
        t_s: f64,
        boundary: &BoundaryConditions,
        watch: Watch,
    ) -> Result<Box<dyn RunningMachine>, StructureError> {
        let steady_state = steady::settle_under(model, boundary)?;
        Ok(self.start(model, t_s, steady_state.state, watch))
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
