//! What a diagnosis is given.

use crate::gap::causes::additions::Calibration;
use crate::gap::experiment::{Experiment, GapWarning};
use mapper_core::{ModelTolerances, Recording, RigActuators, Soak};
use mapper_identify::IdentifyConfig;
use mapper_observe::declared::Declared;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use std::sync::Arc;

/// Input of a diagnosis.
pub struct GapRequest<'a> {
    /// The recording to explain.
    pub recording: RigRecording,
    /// A recording of the same rig and steps in its reference condition; the diagnosis then explains the changes since.
    pub baseline: Option<BaselineRecording>,
    /// Candidate effects.
    pub effects: Vec<Arc<dyn Effect>>,
    /// Experiments allowed on this machine to distinguish causes; if they contain no jump, the recorded jumps are allowed.
    pub experiments: Vec<Experiment>,
    /// When to search for closure terms outside the library.
    pub closure_search: ClosureSearch,
    /// Constants of the probabilities.
    pub calibration: Calibration,
    /// Limits that are known from reading the file.
    pub warnings: Vec<GapWarning>,
    /// Receives the completed share and the name of the next stage.
    pub progress: &'a (dyn Fn(f64, &str) + Sync),
}

/// A recording with what its campaign declares of machine and rig.
#[derive(Debug, Clone)]
pub struct RigRecording {
    /// The recording, with one reading per channel.
    pub recording: Recording,
    /// The nominal machine in the recorded air.
    pub model: Model,
    /// Declared uncertainty of the sensors, geometry, and what a usable recording is.
    pub identification: IdentifyConfig,
    /// The soak before the first step, from which the zero is taken.
    pub zero: Option<Soak>,
    /// Boundary conditions for channels that are not recorded.
    pub boundary: BoundaryConditions,
    /// Tolerances of the nominal machine.
    pub tolerances: ModelTolerances,
    /// Declared motion of the actuators.
    pub actuators: Option<RigActuators>,
    /// Whether the campaign declares tolerances. If not, default tolerances hold, and the actuator responses are estimated from the recording.
    pub tolerances_declared: bool,
    /// Whether drift is searched in repeats.
    pub has_drift_search: bool,
}

impl RigRecording {
    /// A simulated recording: its rig does not drift, and it has no soak.
    pub fn simulated(recording: Recording, declared: Declared, model: Model) -> RigRecording {
        let Declared { sensors, noise_colour, tolerances, nominal, actuators, .. } = declared;
        RigRecording {
            recording,
            model,
            identification: IdentifyConfig { declared: sensors, noise_colour, ..IdentifyConfig::default() },
            zero: None,
            boundary: nominal,
            tolerances,
            actuators,
            tolerances_declared: true,
            has_drift_search: false,
        }
    }

    pub(crate) fn declared(&self) -> Declared {
        Declared {
            sensors: self.identification.declared.clone(),
            noise_colour: self.identification.noise_colour,
            tolerances: self.tolerances,
            nominal: self.boundary,
            common_offsets: Vec::new(),
            actuators: self.actuators,
        }
    }
}

/// A reference recording of the same rig and steps.
#[derive(Debug, Clone)]
pub struct BaselineRecording {
    /// Display name.
    pub name: String,
    /// The recording.
    pub recording: RigRecording,
}

/// When to search for closure terms outside the effect library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClosureSearch {
    /// If the library leaves a part of the gap.
    IfUnexplained,
    /// Also if nothing is beyond tolerance, to measure how often closure terms are found there.
    Always,
    /// Never: only the scores of the library are of interest.
    Never,
}
