//! The true inputs of the machine, and its run with them.

use crate::gap::best_fit::coordinate::typical;
use crate::gap::residuals::nuisance::{Circumstances, Hypothesis, NuisanceKind, OUTPUTS};
use mapper_core::{Channel, Recording};
use mapper_numerics::ROUNDING;
use mapper_numerics::least_squares::ROUNDS;
use mapper_observe::averages::{INPUT_CHANNELS, Table, boundary_condition, mean_reading};
use mapper_observe::declared::Declared;
use mapper_observe::model_inputs::lagged_command::{
    LaggedCommand, Response, measured_p3_response, measured_valve_response,
};
use mapper_observe::model_inputs::smoothed_inputs::SmoothedInputs;
use mapper_observe::model_inputs::step_timing::{Times, with_command_times};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{Effect, Rig, add};
use mapper_physics::rig::instruments::{ChannelPath, Surroundings, true_value};
use mapper_physics::simulation::linearised_run::LinearisedRun;
use mapper_physics::simulation::model::{Model, Outputs, PreparedModel, State};
use mapper_physics::simulation::steady::Inputs;
use std::sync::{Arc, OnceLock};

/// Walls and flows along a recording: they scale the errors of sensors.
#[derive(Debug, Clone, Default)]
pub(crate) struct SurroundingsHistory {
    pub(crate) t_s: Vec<f64>,
    /// Values of [`MEASURED`]; flows as ratios.
    pub(crate) rows: Vec<[f64; MEASURED.len()]>,
}

/// Wall and flow of the compressor, and of the turbine.
pub(crate) const MEASURED: [Channel; 4] =
    [Channel::Tc, Channel::CompressorFlow, Channel::Tt, Channel::TurbineFlow];

impl SurroundingsHistory {
    /// Surroundings of a sensor at a time; `None` without a history.
    fn at(&self, channel: Channel, t_s: f64, opening_ratio: f64) -> Option<Surroundings> {
        let after = self.t_s.partition_point(|t| *t <= t_s).min(self.rows.len().checked_sub(1)?);
        let before = after.saturating_sub(1);
        let span_s = self.t_s[after] - self.t_s[before];
        let share = if span_s > 0.0 { ((t_s - self.t_s[before]) / span_s).clamp(0.0, 1.0) } else { 0.0 };
        let at = |i: usize| self.rows[before][i] + share * (self.rows[after][i] - self.rows[before][i]);
        let first = if Surroundings::channels(channel).0 == Channel::Tt { 2 } else { 0 };
        Some(Surroundings { wall_k: at(first), flow_ratio: at(first + 1), opening_ratio })
    }
}

/// The inputs of a recording without the errors that its circumstances give their sensors.
#[derive(Debug, Clone)]
pub(crate) struct TrueInputs<'a> {
    pub(crate) recorded: &'a SmoothedInputs,
    /// The commands with the valve as it moves; `None` if it moves as declared.
    pub(crate) moved: Option<LaggedCommand>,
    /// Errors of their sensors.
    pub(crate) circumstances: &'a Circumstances,
    /// Quantities that act on the sensors; `None` if no error depends on them.
    pub(crate) history: Option<&'a SurroundingsHistory>,
}

impl TrueInputs<'_> {
    /// The value behind a reading. An input's lag is not modelled: a stand holds its inputs, and that of P3 is its actuator's.
    fn true_value(
        &self,
        t_s: f64,
        channel: Channel,
        path: &ChannelPath,
        read: f64,
        opening_ratio: f64,
    ) -> f64 {
        let at_sensor = (read - path.offset) / path.gain_ratio;
        let around = self.history.and_then(|history| history.at(channel, t_s, opening_ratio));
        around.map_or(at_sensor, |around| path.behind(at_sensor, &around))
    }
}

impl Inputs for TrueInputs<'_> {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let mut boundary = self.recorded.at(t_s);
        if let Some(moved) = &self.moved {
            boundary.valve_opening_ratio = moved.valve_opening_ratio(t_s);
        }
        let opening_ratio = boundary.valve_opening_ratio;
        for (channel, path) in INPUT_CHANNELS.into_iter().zip(&self.circumstances.paths) {
            if *path != ChannelPath::default()
                && let Some(value) = boundary_condition(&mut boundary, channel)
            {
                *value = self.true_value(t_s, channel, path, *value, opening_ratio);
            }
        }
        for (perturbation, by) in &self.circumstances.perturbations {
            perturbation.adjust_boundary(&mut boundary, *by);
        }
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.recorded.next_kink_s(t_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        self.recorded.is_constant_after(t_s)
    }
}

/// Response of P3 and the valve to their commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuators {
    /// P3; Pa/s.
    pub p3: Response,
    /// The valve; 1/s.
    pub valve: Response,
    /// Whether P3 is compared with its declared response.
    pub judged: bool,
}

impl Actuators {
    /// With declared tolerances, measured P3 drives the model and the valve moves as declared; without, both responses are estimated.
    pub fn of(
        table: &Table,
        recording: &Recording,
        (declared, model): (&Declared, &Model),
        judged: bool,
    ) -> Actuators {
        let (p3, timed) = timed_p3(table, recording, declared);
        let valve = Response::of_valve(declared.actuators.as_ref());
        let outlet = (declared.nominal.p1_pa, model.params.outlet.volume_m3);
        let measured = || measured_valve_response(table, &timed, outlet, valve);
        let valve = if judged { valve } else { measured().unwrap_or(valve) };
        Actuators { p3, valve, judged }
    }
}

/// Estimates the P3 response and shifts the steps to when their commands reached the rig; each estimate uses the other.
fn timed_p3(table: &Table, recording: &Recording, declared: &Declared) -> (Response, Recording) {
    let noise_sigma = declared.noise_sigma(Channel::P3);
    let follows = |recording: &Recording| {
        let p3 = measured_p3_response(table, recording, noise_sigma);
        p3.unwrap_or(Response::lag(declared.tolerances.actuator_lag_s))
    };
    let commanded = with_command_times(recording);
    let (mut p3, mut timed) = (follows(&commanded), commanded.clone());
    for _ in 0..ROUNDS {
        let next = Times::read(table, &commanded, p3, noise_sigma).timed(&commanded);
        if next.steps == timed.steps {
            break;
        }
        (p3, timed) = (follows(&next), next);
    }
    (p3, timed)
}

/// The model with its metal so heavy that its temperatures hold while everything else settles.
pub(crate) fn with_metal_held(model: &Model) -> Model {
    let mut heavy = model.clone();
    heavy.params.compressor.housing_mass_kg /= ROUNDING;
    heavy.params.turbine.housing_mass_kg /= ROUNDING;
    heavy
}

/// Time in which everything but the housings settles from an unknown state, s. Bound: several times the lag of a sheathed probe, the slowest part.
pub(crate) const SETTLING_S: f64 = 30.0;
/// Rate above which the initial metal temperatures are not settled, K/s. Bound: some hundred times noise, and a tenth of that of a machine started
/// cold minutes ago.
const RESTLESS_K_S: f64 = 0.05;
/// Part of that time over which readings are averaged at its start and at its end. Bound: noise; the rest remains between the two.
const AVERAGED_SHARE: f64 = 0.3;
/// Distance of the two averages as a share of that time.
const BETWEEN_SHARE: f64 = 1.0 - AVERAGED_SHARE;

/// Whether the metal temperatures are steady when the first step of a recording begins.
pub(crate) fn rested(table: &Table, start_s: f64) -> bool {
    [Channel::Tc, Channel::Tt].into_iter().all(|channel| {
        let Some(column) = table.column(channel) else { return true };
        let middle = |from_s: f64| {
            let range = table.range(from_s, from_s + AVERAGED_SHARE * SETTLING_S);
            mean_reading(&column[range].iter().copied().filter(|v| v.is_finite()).collect::<Vec<_>>())
        };
        let (Some(first), Some(last)) = (middle(start_s), middle(start_s + BETWEEN_SHARE * SETTLING_S))
        else {
            return true;
        };
        (last - first).abs() < RESTLESS_K_S * BETWEEN_SHARE * SETTLING_S
    })
}

/// One run of the machine: the quantities at its sensors, at each time of a study.
#[derive(Debug, Clone)]
pub(crate) struct MachineRun {
    pub(crate) machine: Hypothesis,
    /// Whether the model was integrated; if not, the run follows from another.
    pub(crate) is_exact: bool,
    pub(crate) samples: Vec<Sample>,
}

/// A run of the machine with its derivatives, which are computed when first needed.
#[derive(Debug)]
pub(crate) struct LinearisedMachine {
    pub(crate) run: Arc<MachineRun>,
    /// `None` if the run has no derivatives everywhere.
    pub(crate) linear: OnceLock<Option<LinearisedSamples>>,
}

impl LinearisedMachine {
    pub(crate) fn of(run: &Arc<MachineRun>) -> LinearisedMachine {
        LinearisedMachine { run: run.clone(), linear: OnceLock::new() }
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    /// True values of [`OUTPUTS`].
    pub(crate) values: [f64; OUTPUTS.len()],
    /// Surroundings of the sensors of the compressor, and of the turbine.
    surroundings: [Surroundings; 2],
    /// Temperature drop of the gas through the turbine, K.
    pub(crate) turbine_drop_k: f64,
}

pub(crate) type SampleValues = [f64; OUTPUTS.len() + 7];
pub(crate) type LinearisedSamples = LinearisedRun<{ OUTPUTS.len() + 7 }>;

impl Sample {
    pub(crate) fn to_array(self) -> SampleValues {
        let [compressor, turbine] = self.surroundings;
        let around = |at: Surroundings| [at.wall_k, at.flow_ratio, at.opening_ratio];
        let mut all = self.values.into_iter().chain(around(compressor)).chain(around(turbine));
        std::array::from_fn(|_| all.next().unwrap_or(self.turbine_drop_k))
    }

    pub(crate) fn from_array(all: SampleValues) -> Sample {
        let at = |i: usize| all[OUTPUTS.len() + i];
        let around =
            |i: usize| Surroundings { wall_k: at(i), flow_ratio: at(i + 1), opening_ratio: at(i + 2) };
        Sample {
            values: std::array::from_fn(|i| all[i]),
            surroundings: [around(0), around(3)],
            turbine_drop_k: at(6),
        }
    }

    pub(crate) fn of(prepared: &PreparedModel<'_>, state: &State, outputs: &Outputs) -> Sample {
        let opening_ratio = prepared.boundary().valve_opening_ratio;
        let around = |channel, wall_k, flow_kg_s| {
            let flow_ratio = Surroundings::flow_ratio(&prepared.model().params, channel, flow_kg_s);
            Surroundings { wall_k, flow_ratio, opening_ratio }
        };
        Sample {
            values: OUTPUTS.map(|channel| true_value(channel, prepared, state, outputs).unwrap_or(f64::NAN)),
            surroundings: [
                around(Channel::T2, state.tc_k, outputs.flow_kg_s),
                around(Channel::T4, state.tt_k, outputs.turbine_flow_kg_s),
            ],
            turbine_drop_k: outputs.turbine.t3_prime_k - outputs.turbine.t4_k,
        }
    }

    pub(crate) fn surroundings(&self, channel: Channel) -> &Surroundings {
        &self.surroundings[usize::from(Surroundings::channels(channel).0 == Channel::Tt)]
    }
}

/// Whether an effect changes the machine or its inputs, and not only sensors of outputs.
pub(crate) fn acts_on_machine(nominal: &Rig, effect: &dyn Effect) -> bool {
    let values: Vec<f64> = effect.info().parameters.iter().map(typical).collect();
    let mut rig = nominal.clone();
    if add(&mut rig, effect, &values).is_err() {
        return true;
    }
    let same_path = |channel: &Channel| rig.instruments.path(*channel) == nominal.instruments.path(*channel);
    rig.model.params != nominal.model.params
        || !Arc::ptr_eq(&rig.model.map, &nominal.model.map)
        || !rig.model.hooks.is_empty()
        || rig.instruments.valve != nominal.instruments.valve
        || !INPUT_CHANNELS.iter().all(same_path)
}

impl NuisanceKind {
    /// Whether it changes the machine or its inputs, and not only sensors of outputs.
    pub(crate) fn is_on_machine(self) -> bool {
        match self {
            NuisanceKind::TurbineDrop | NuisanceKind::Delay(_) | NuisanceKind::Structure(..) => false,
            NuisanceKind::Offset(channel) | NuisanceKind::Gain(channel) => INPUT_CHANNELS.contains(&channel),
            NuisanceKind::CommonOffset(_)
            | NuisanceKind::Perturbation(_)
            | NuisanceKind::Shape(_)
            | NuisanceKind::ValveLag
            | NuisanceKind::ValveStroke => true,
        }
    }
}
