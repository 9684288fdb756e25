//! The running machine: the lumped model, or other equations in the same rig; its boundary conditions, from the test cell and from the actuators
//! that follow the commands.

use crate::virtual_lab::name::NAME;
use crate::virtual_lab::rig::actuator::{Actuator, ActuatorDynamics};
use crate::virtual_lab::rig::drift::Weather;
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::inputs::Inputs;
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

/// Minimum ratio of air supply to P4 while the model runs: the model divides by the turbine's flow.
pub const MIN_EXPANSION_RATIO: f64 = 1.0005;

/// The conditions of the cell, and the actuators.
#[derive(Debug, Clone)]
pub struct LabInputs {
    /// T1, P1, P4 and the ambient temperature.
    pub cell: BoundaryConditions,
    /// Slow fluctuations of the boundary conditions.
    pub weather: Weather,
    /// Turbine inlet pressure, Pa.
    pub p3: Actuator,
    /// Turbine inlet temperature, K.
    pub t3: Actuator,
    /// Valve opening.
    pub valve: Actuator,
    /// Oil temperature, K.
    pub oil: Actuator,
}

impl LabInputs {
    /// Constant inputs at `boundary`.
    pub fn constant(boundary: &BoundaryConditions) -> Self {
        let at_rest = |value: f64| Actuator::at_rest(ActuatorDynamics::AT_ONCE, value);
        LabInputs {
            cell: *boundary,
            weather: Weather::default(),
            p3: at_rest(boundary.p3_pa),
            t3: at_rest(boundary.t3_k),
            valve: at_rest(boundary.valve_opening_ratio),
            oil: at_rest(boundary.oil_temperature_k),
        }
    }

    fn actuators(&self) -> [&Actuator; 4] {
        [&self.p3, &self.t3, &self.valve, &self.oil]
    }
}

impl Inputs for LabInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let mut boundary = BoundaryConditions {
            p3_pa: self.p3.value(t_s),
            t3_k: self.t3.value(t_s),
            valve_opening_ratio: self.valve.value(t_s),
            oil_temperature_k: self.oil.value(t_s),
            ..self.cell
        };
        if !self.weather.is_calm() {
            boundary = self.weather.add_to(boundary, t_s);
        }
        boundary.p3_pa = boundary.p3_pa.max(boundary.p4_pa * MIN_EXPANSION_RATIO);
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.actuators().map(|actuator| actuator.next_kink_s(t_s)).into_iter().fold(f64::INFINITY, f64::min)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        self.weather.is_calm() && self.actuators().iter().all(|actuator| actuator.has_arrived(t_s))
    }
}
