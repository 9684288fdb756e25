//! A run of the machine, which hypotheses share if they differ only in the sensors of outputs.

use crate::gap::best_fit::coordinate::typical;
use crate::gap::residuals::hypothesis::Hypothesis;
use crate::gap::residuals::nuisance::{NuisanceKind, OUTPUTS};
use mapper_core::Channel;
use mapper_observe::channels::INPUT_CHANNELS;
use mapper_physics::rig::effect::{Effect, Rig, add};
use mapper_physics::rig::instruments::{Surroundings, true_value};
use mapper_physics::simulation::model::{Outputs, PreparedModel, State};
use std::sync::Arc;

/// One run of the machine: the quantities at its sensors, at each time of a study.
#[derive(Debug, Clone)]
pub(crate) struct MachineRun {
    /// The hypothesis without sensors of outputs.
    pub(crate) machine: Hypothesis,
    pub(crate) samples: Vec<Sample>,
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

impl Sample {
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
        || !INPUT_CHANNELS.iter().all(same_path)
}

impl NuisanceKind {
    /// Whether it changes the machine or its inputs, and not only sensors of outputs.
    pub(crate) fn is_on_machine(self) -> bool {
        match self {
            NuisanceKind::TurbineDrop | NuisanceKind::Delay(_) | NuisanceKind::Structure(..) => false,
            NuisanceKind::Offset(channel) | NuisanceKind::Gain(channel) => INPUT_CHANNELS.contains(&channel),
            NuisanceKind::CommonOffset(_) | NuisanceKind::Perturbation(_) | NuisanceKind::Shape(_) => true,
        }
    }
}
