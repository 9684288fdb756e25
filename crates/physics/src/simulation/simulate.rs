//! Integrates the model; returns samples at given times and events when they occur.

use crate::machine::params::{BoundaryConditions, MAX_STATES, Params};
use crate::simulation::model::{BoundaryError, Model, Outputs, PreparedModel, State};
use crate::simulation::rosenbrock::{IntegrationError, Integrator, OdeSystem, Step, Tolerances};
use crate::simulation::steady::Inputs;
use mapper_numerics::root::bisect;
use nalgebra::{Const, DimMin};

/// Thresholds of events.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watch {
    /// Shaft speed of the overspeed event, rpm.
    pub overspeed_rpm: f64,
}

impl Default for Watch {
    fn default() -> Self {
        Watch { overspeed_rpm: f64::INFINITY }
    }
}

/// A threshold that was crossed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Crossing {
    /// Into surge.
    SurgeEntered,
    /// Back from surge.
    SurgeLeft,
    /// Above the overspeed limit.
    OverspeedEntered,
    /// Back below the overspeed limit.
    OverspeedLeft,
}

/// A crossing with its time and state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelEvent {
    /// Time, s.
    pub t_s: f64,
    /// The threshold.
    pub crossing: Crossing,
    /// Shaft speed at the crossing, rpm.
    pub speed_rpm: f64,
    /// Pressure ratio at the crossing.
    pub pressure_ratio: f64,
}

/// Reason why a simulation could not continue.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum SimulationError {
    #[error("at {t_s:.3} s: {source}")]
    Boundary { t_s: f64, source: BoundaryError },
    #[error(transparent)]
    Integration(#[from] IntegrationError),
}

/// A running machine, which can be advanced step by step.
#[derive(Debug, Clone)]
pub struct Simulator {
    model: Model,
    integrator: SizedIntegrator,
    crossings: CrossingWatch,
}

/// An integrator with the number of states of the model, so that the nominal model has no linear algebra for unused states.
#[derive(Debug, Clone)]
enum SizedIntegrator {
    /// For a model without inner wall and hidden temperatures.
    Five(Integrator<5>),
    /// For a model with an inner wall.
    Six(Integrator<6>),
    /// For a model with hidden temperatures.
    All(Integrator<MAX_STATES>),
}

/// Evaluates the same expression for an integrator of any size.
macro_rules! sized {
    ($integrator:expr, $name:ident => $body:expr) => {
        match $integrator {
            SizedIntegrator::Five($name) => $body,
            SizedIntegrator::Six($name) => $body,
            SizedIntegrator::All($name) => $body,
        }
    };
}

/// Detects crossings from step to step.
#[derive(Debug, Clone)]
struct CrossingWatch {
    watch: Watch,
    /// Surge position minus 1, and speed minus limit, at the end of the last step; `None` before the first.
    margins: Option<[f64; 2]>,
}

/// Local error allowed by default, relative: three orders below the noise of any sensor.
pub const DEFAULT_RELATIVE_TOLERANCE: f64 = 1e-6;

/// Typical magnitudes of the states.
pub(crate) const STATE_SIZES: [f64; MAX_STATES] = [1e4, 1e5, 3e2, 5e2, 3e2, 3e2, 3e2, 3e2];

impl SizedIntegrator {
    fn new(model: &Model, t_s: f64, state: State, relative_ratio: f64) -> Self {
        if model.hooks.extra_states() > 0 {
            SizedIntegrator::All(Integrator::new(t_s, state.to_array(), tolerances(relative_ratio)))
        } else if model.has_inner_wall() {
            SizedIntegrator::Six(Integrator::new(t_s, state.to_array(), tolerances(relative_ratio)))
        } else {
            SizedIntegrator::Five(Integrator::new(t_s, state.to_array(), tolerances(relative_ratio)))
        }
    }
}

/// Tolerances of a step in all states, from the relative tolerance and the states' magnitudes.
pub(crate) fn tolerances<const N: usize>(relative_ratio: f64) -> Tolerances<N> {
    // Absolute parts: a thousandth of each state's typical magnitude.
    Tolerances { relative_ratio, absolute: std::array::from_fn(|i| 1e-3 * STATE_SIZES[i] * relative_ratio) }
}

impl Simulator {
    /// A machine at `state` at `t_s`, integrated to `relative_tolerance` per step.
    pub fn new(model: &Model, t_s: f64, state: State, relative_tolerance: f64, watch: Watch) -> Self {
        Simulator {
            model: model.clone(),
            integrator: SizedIntegrator::new(model, t_s, state, relative_tolerance),
            crossings: CrossingWatch { watch, margins: None },
        }
    }

    /// Current state.
    pub fn state(&self) -> State {
        sized!(&self.integrator, integrator => State::from_array(&integrator.y))
    }

    /// Steps taken so far.
    pub fn steps(&self) -> usize {
        sized!(&self.integrator, integrator => integrator.steps())
    }

    /// Continues with other parameters of the machine, e.g. while it fouls. The states of the model must not change, nor
    /// whether it has an inner wall.
    pub fn change_params(&mut self, params: Params) {
        if params != self.model.params {
            self.model.params = params;
            self.restart();
        }
    }

    /// Forgets the step size; call after a jump of the inputs.
    pub fn restart(&mut self) {
        sized!(&mut self.integrator, integrator => integrator.restart());
    }

    /// Runs to `end_s`. Calls `on_sample` with time, state and outputs at each of `sample_times_s` (rising, within
    /// the interval; the interval's start is allowed), and `on_event` at each crossing, in order of time.
    pub fn run_to(
        &mut self,
        end_s: f64,
        inputs: &impl Inputs,
        sample_times_s: impl IntoIterator<Item = f64>,
        on_sample: impl FnMut(f64, &State, &Outputs),
        on_event: impl FnMut(ModelEvent),
    ) -> Result<(), SimulationError> {
        let Simulator { model, integrator, crossings } = self;
        sized!(integrator, integrator =>
            run(model, integrator, crossings, end_s, inputs, sample_times_s, on_sample, on_event))
    }
}

/// [`Simulator::run_to`] with `N` states.
#[allow(
    clippy::too_many_arguments,
    reason = "the simulator's own parts, taken apart so that its size can be a type"
)]
fn run<const N: usize>(
    model: &Model,
    integrator: &mut Integrator<N>,
    crossings: &mut CrossingWatch,
    end_s: f64,
    inputs: &impl Inputs,
    sample_times_s: impl IntoIterator<Item = f64>,
    mut on_sample: impl FnMut(f64, &State, &Outputs),
    mut on_event: impl FnMut(ModelEvent),
) -> Result<(), SimulationError>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let mut samples = sample_times_s.into_iter().peekable();
    let mut sample = |t_s: f64, y: &[f64; N], prepared: &PreparedModel<'_>| {
        let state = State::from_array(y);
        on_sample(t_s, &state, &prepared.evaluate(&state));
    };
    while let Some(t_s) = samples.next_if(|t| *t <= integrator.t_s) {
        let boundary = checked(inputs, t_s)?;
        sample(t_s, &integrator.y, &model.prepare(&boundary));
    }
    while integrator.t_s < end_s {
        let start_s = integrator.t_s;
        let kink_s = inputs.next_kink_s(start_s);
        let stretch_end_s = kink_s.min(end_s);
        let boundary = checked(inputs, start_s)?;
        let prepared = model.prepare_at(inputs.time_s(start_s), &boundary);
        let constant = inputs.is_constant_after(start_s);
        let mut system = ModelSystem { model, prepared, inputs, constant };
        while integrator.t_s < stretch_end_s {
            let step = integrator.step(&mut system, stretch_end_s)?;
            crossings.report(&step, &mut system, &mut on_event);
            while let Some(t_s) = samples.next_if(|t| *t <= step.t1_s) {
                system.prepare_for(t_s);
                sample(t_s, &step.at(t_s), &system.prepared);
            }
        }
        if kink_s <= end_s {
            integrator.restart();
        }
    }
    Ok(())
}

impl CrossingWatch {
    fn report<const N: usize>(
        &mut self,
        step: &Step<N>,
        system: &mut ModelSystem<'_, impl Inputs>,
        on_event: &mut impl FnMut(ModelEvent),
    ) {
        let before = match self.margins {
            Some(margins) => margins,
            None => self.margins_at(step.t0_s, &step.y0, system),
        };
        let after = self.margins_at(step.t1_s, &step.y1, system);
        self.margins = Some(after);
        let mut events: Vec<ModelEvent> = Vec::new();
        for (which, [entered, left]) in [
            [Crossing::SurgeEntered, Crossing::SurgeLeft],
            [Crossing::OverspeedEntered, Crossing::OverspeedLeft],
        ]
        .into_iter()
        .enumerate()
        {
            let inside = |margin: f64| margin > 0.0;
            if inside(before[which]) == inside(after[which]) {
                continue;
            }
            // Bisection to a microsecond: the margin is continuous and changes sign once.
            let (_, high_s) = bisect(step.t0_s, step.t1_s, 1e-6, |t_s| {
                inside(self.margins_at(t_s, &step.at(t_s), system)[which]) == inside(before[which])
            });
            let state = State::from_array(&step.at(high_s));
            events.push(ModelEvent {
                t_s: high_s,
                crossing: if inside(after[which]) { entered } else { left },
                speed_rpm: state.shaft_speed_rpm(),
                pressure_ratio: state.p2_pa / system.prepared.boundary().p1_pa,
            });
        }
        events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        events.into_iter().for_each(on_event);
    }

    /// Surge position minus 1; shaft speed minus its limit, rpm.
    fn margins_at<const N: usize>(
        &self,
        t_s: f64,
        y: &[f64; N],
        system: &mut ModelSystem<'_, impl Inputs>,
    ) -> [f64; 2] {
        system.prepare_for(t_s);
        let boundary = system.prepared.boundary();
        let state = State::from_array(y);
        let speed_rpm = state.shaft_speed_rpm();
        let map = &system.model.map;
        let corrected_rpm = map.reference().corrected_speed_rpm(speed_rpm, boundary.t1_k);
        let on_map = map.evaluate(corrected_rpm, state.p2_pa / boundary.p1_pa);
        [on_map.surge_position_ratio - 1.0, speed_rpm - self.watch.overspeed_rpm]
    }
}

fn checked(inputs: &impl Inputs, t_s: f64) -> Result<BoundaryConditions, SimulationError> {
    let boundary = inputs.at(t_s);
    boundary.check().map_err(|source| SimulationError::Boundary { t_s, source })?;
    Ok(boundary)
}

struct ModelSystem<'a, I: Inputs> {
    model: &'a Model,
    prepared: PreparedModel<'a>,
    inputs: &'a I,
    constant: bool,
}

impl<I: Inputs> ModelSystem<'_, I> {
    fn prepare_for(&mut self, t_s: f64) {
        if !self.constant {
            self.prepared = self.model.prepare_at(self.inputs.time_s(t_s), &self.inputs.at(t_s));
        }
    }
}

impl<const N: usize, I: Inputs> OdeSystem<N> for ModelSystem<'_, I> {
    fn rates(&mut self, t_s: f64, y: &[f64; N]) -> [f64; N] {
        self.prepare_for(t_s);
        let state = State::from_array(y);
        let outputs = self.prepared.evaluate(&state);
        self.prepared.derivatives(&state, &outputs)
    }

    fn depends_on_time(&self) -> bool {
        !self.constant
    }
}
