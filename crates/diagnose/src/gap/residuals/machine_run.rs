//! A run of the machine, which hypotheses share if they differ only in the sensors of outputs.

use crate::gap::best_fit::coordinate::typical;
use crate::gap::residuals::nuisance::Hypothesis;
use crate::gap::residuals::nuisance::{NuisanceKind, OUTPUTS};
use mapper_core::Channel;
use mapper_observe::channels::INPUT_CHANNELS;
use mapper_physics::rig::effect::{Effect, Rig, add};
use mapper_physics::rig::instruments::{Surroundings, true_value};
use mapper_physics::simulation::linearised_run::LinearisedRun;
use mapper_physics::simulation::model::{Outputs, PreparedModel, State};
use std::sync::{Arc, OnceLock};

/// One run of the machine: the quantities at its sensors, at each time of a study.
#[derive(Debug, Clone)]
pub(crate) struct MachineRun {
    /// The hypothesis without sensors of outputs.
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

/// The machine at one time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    /// True values of [`OUTPUTS`].
    pub(crate) values: [f64; OUTPUTS.len()],
    /// Surroundings of the sensors of the compressor, and of the turbine.
    surroundings: [Surroundings; 2],
    /// Temperature drop of the gas through the turbine, K.
    pub(crate) turbine_drop_k: f64,
}

/// The values of a sample.
pub(crate) type SampleValues = [f64; OUTPUTS.len() + 7];
/// A run with its derivatives and those of its samples.
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
            | NuisanceKind::ValveLag => true,
        }
    }
}
