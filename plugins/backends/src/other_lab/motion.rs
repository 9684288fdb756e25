//! Integration of the machine of this lab, and its equations in the rig of the virtual lab.

use crate::other_lab::machine::{NAME, OtherStructure, SIZES, STATES, evaluate, lumped_state, start};
use crate::virtual_lab::{LabInputs, LabSettings, RunningMachine, SecondOrder, Structure, StructureError};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::model::{Model, Outputs, State};
use mapper_physics::simulation::rosenbrock::{Integrator, OdeSystem, Tolerances};
use mapper_physics::simulation::simulate::{
    Crossing, DEFAULT_RELATIVE_TOLERANCE, ModelEvent, SimulationError, Watch,
};
use mapper_physics::simulation::steady;
use mapper_physics::simulation::steady::Inputs;
use std::sync::Arc;

/// Simulated time to a steady state, s: many time constants of the turbine housing.
const SETTLING_TIME_S: f64 = 40_000.0;

/// A running machine with the equations of this lab.
#[derive(Debug)]
pub(crate) struct Motion {
    model: Model,
    structure: OtherStructure,
    watch: Watch,
    /// `None` until the boundary conditions are known.
    integrator: Option<Integrator<STATES>>,
    initial: (f64, State),
    /// Whether the machine was beyond the surge line, and above the speed limit, at the end of the last step.
    beyond: Option<[bool; 2]>,
}

impl Motion {
    pub(crate) fn new(
        model: &Model,
        structure: OtherStructure,
        t_s: f64,
        state: State,
        watch: Watch,
    ) -> Self {
        Motion {
            model: model.clone(),
            structure,
            watch,
            integrator: None,
            initial: (t_s, state),
            beyond: None,
        }
    }

    /// Settles to the steady state under `boundary`, without advancing the lab's time.
    pub(crate) fn settle(&mut self, boundary: &BoundaryConditions) -> Result<(), StructureError> {
        let (t_s, state) = self.initial;
        let mut integrator = Integrator::new(t_s, start(&self.model, boundary, &state), tolerances());
        let mut system = System::new(&self.model, &self.structure, boundary, t_s);
        while integrator.t_s < t_s + SETTLING_TIME_S {
            integrator.step(&mut system, t_s + SETTLING_TIME_S)?;
        }
        self.initial.1 = lumped_state(&integrator.y);
        self.integrator = Some(Integrator::new(t_s, integrator.y, tolerances()));
        Ok(())
    }
}

fn tolerances() -> Tolerances<STATES> {
    let relative_ratio = DEFAULT_RELATIVE_TOLERANCE;
    Tolerances { relative_ratio, absolute: SIZES.map(|size| 1e-3 * size * relative_ratio) }
}

impl RunningMachine for Motion {
    fn state(&self) -> State {
        self.integrator.as_ref().map_or(self.initial.1, |integrator| lumped_state(&integrator.y))
    }

    fn restart(&mut self) {
        if let Some(integrator) = &mut self.integrator {
            integrator.restart();
        }
    }

    fn change_params(&mut self, params: Params) {
        if params != self.model.params {
            self.model.params = params;
            self.restart();
        }
    }

    fn run_to(
        &mut self,
        end_s: f64,
        inputs: &LabInputs,
        sample_times_s: &mut dyn Iterator<Item = f64>,
        on_sample: &mut dyn FnMut(f64, &State, &Outputs),
        on_event: &mut dyn FnMut(ModelEvent),
    ) -> Result<(), SimulationError> {
        let Motion { model, structure, watch, integrator, initial, beyond } = self;
        let integrator = integrator.get_or_insert_with(|| {
            let (t_s, state) = *initial;
            Integrator::new(t_s, start(model, &inputs.at(t_s), &state), tolerances())
        });
        let mut samples = sample_times_s.peekable();
        let mut sample = |t_s: f64, y: &[f64; STATES]| {
            let now = evaluate(model, structure, inputs.time_s(t_s), &inputs.at(t_s), y);
            on_sample(t_s, &now.state, &now.outputs);
        };
        while let Some(t_s) = samples.next_if(|t| *t <= integrator.t_s) {
            sample(t_s, &integrator.y);
        }
        while integrator.t_s < end_s {
            let start_s = integrator.t_s;
            let boundary = inputs.at(start_s);
            boundary.check().map_err(|source| SimulationError::Boundary { t_s: start_s, source })?;
            let kink_s = inputs.next_kink_s(start_s);
            let segment_end_s = kink_s.min(end_s);
            let mut system = System::new(model, structure, inputs, start_s);
            while integrator.t_s < segment_end_s {
                let step = integrator.step(&mut system, segment_end_s)?;
                while let Some(t_s) = samples.next_if(|t| *t <= step.t1_s) {
                    sample(t_s, &step.at(t_s));
                }
                report_crossings(model, structure, *watch, inputs, (step.t1_s, &step.y1), beyond, on_event);
            }
            if kink_s <= end_s {
                integrator.restart();
            }
        }
        Ok(())
    }
}

/// Reports crossings of limits since the last step, at the end of the step: steps are far shorter than a sample.
fn report_crossings(
    model: &Model,
    structure: &OtherStructure,
    watch: Watch,
    inputs: &LabInputs,
    (t_s, y): (f64, &[f64; STATES]),
    beyond: &mut Option<[bool; 2]>,
    on_event: &mut dyn FnMut(ModelEvent),
) {
    let now = evaluate(model, structure, inputs.time_s(t_s), &inputs.at(t_s), y);
    let speed_rpm = now.state.shaft_speed_rpm();
    let pressure_ratio = now.outputs.pressure_ratio;
    let is_beyond = [now.outputs.surge_position_ratio > 1.0, speed_rpm > watch.overspeed_rpm];
    let was_beyond = beyond.replace(is_beyond).unwrap_or(is_beyond);
    let crossings = [
        [Crossing::SurgeEntered, Crossing::SurgeLeft],
        [Crossing::OverspeedEntered, Crossing::OverspeedLeft],
    ];
    for ((was, is), [entered, left]) in was_beyond.into_iter().zip(is_beyond).zip(crossings) {
        if was != is {
            let crossing = if is { entered } else { left };
            on_event(ModelEvent { t_s, crossing, speed_rpm, pressure_ratio });
        }
    }
}

struct System<'a, I> {
    model: &'a Model,
    structure: &'a OtherStructure,
    inputs: &'a I,
    constant: bool,
}

impl<'a, I: Inputs> System<'a, I> {
    fn new(model: &'a Model, structure: &'a OtherStructure, inputs: &'a I, t_s: f64) -> Self {
        System { model, structure, inputs, constant: inputs.is_constant_after(t_s) }
    }
}

impl<I: Inputs> OdeSystem<STATES> for System<'_, I> {
    fn rates(&mut self, t_s: f64, y: &[f64; STATES]) -> [f64; STATES] {
        evaluate(self.model, self.structure, self.inputs.time_s(t_s), &self.inputs.at(t_s), y).rates
    }

    fn depends_on_time(&self) -> bool {
        !self.constant
    }
}

/// Replaces the equations and sensors of a virtual lab by those of this lab.
pub fn apply_structure(lab: &mut LabSettings, structure: OtherStructure) {
    let sensors = structure.sensors();
    lab.second_order = sensors
        .into_iter()
        .map(|(channel, frequency_hz, damping_ratio)| (channel, SecondOrder { frequency_hz, damping_ratio }))
        .collect();
    lab.structure = Arc::new(structure);
}

impl Structure for OtherStructure {
    fn name(&self) -> &'static str {
        NAME
    }

    fn start(&self, model: &Model, t_s: f64, state: State, watch: Watch) -> Box<dyn RunningMachine> {
        Box::new(Motion::new(model, self.clone(), t_s, state, watch))
    }

    fn settled(
        &self,
        model: &Model,
        t_s: f64,
        boundary: &BoundaryConditions,
        watch: Watch,
    ) -> Result<Box<dyn RunningMachine>, StructureError> {
        // Start from the steady state of the lumped model, and settle to that of these equations.
        let lumped = steady::settle_under(model, boundary)?;
        let mut motion = Motion::new(model, self.clone(), t_s, lumped.state, watch);
        motion.settle(boundary)?;
        Ok(Box::new(motion))
    }
}
