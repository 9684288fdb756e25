//! The input of the diagnosis, and its errors.

use crate::drift::causes::cause::Cause;
use mapper_core::{Channel, ModelTolerances, Recording};
use mapper_identify::IdentifyConfig;
use mapper_observe::declared::Declared;
use mapper_observe::plausible::Implausible;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::inputs::InputsError;
use mapper_physics::simulation::model::Model;

/// A recording with the identity of its campaign and machine.
#[derive(Debug, Clone, Copy)]
pub struct RecordedRun<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// Identity of campaign and machine, e.g. their hashes; `None` if unknown.
    pub fingerprint: Option<&'a str>,
}

/// Consecutive runs of one machine, with the declarations of machine and rig.
#[derive(Debug, Clone, Copy)]
pub struct DriftRequest<'a> {
    /// The recordings in the order in which they were made.
    pub runs: &'a [RecordedRun<'a>],
    /// The nominal machine.
    pub model: &'a Model,
    /// Boundary conditions for channels that are not recorded.
    pub boundary: BoundaryConditions,
    /// Tolerances of the nominal machine: a constant deviation within them is not drift.
    pub tolerances: ModelTolerances,
    /// Declared uncertainty, window, geometry.
    pub identification: &'a IdentifyConfig,
}

impl DriftRequest<'_> {
    /// The declarations of rig and machine.
    pub(crate) fn declared(&self) -> Declared {
        Declared {
            sensors: self.identification.declared.clone(),
            noise_colour: self.identification.noise_colour,
            tolerances: self.tolerances,
            nominal: self.boundary,
            common_offsets: Vec::new(),
        }
    }
}

/// Why recordings cannot be diagnosed at all.
#[derive(Debug, thiserror::Error)]
pub enum DriftError {
    /// No recording was given.
    #[error("no recording was given")]
    NoRun,
    /// No command changes.
    #[error("recording {} has no steps: P3_command and valve_command are constant or missing; map them", .run + 1)]
    NoSteps {
        /// Which recording, from 0.
        run: usize,
    },
    /// Channels that the diagnosis needs are missing.
    #[error("recording {} has no {}; the drift diagnosis needs N, P2, T1 and T2", .run + 1, symbols(.channels))]
    MissingChannels {
        /// Which recording, from 0.
        run: usize,
        /// The missing channels.
        channels: Vec<Channel>,
    },
    /// A channel has many invalid readings.
    #[error(
        "recording {}: {missing} of {all} readings of {channel} are not numbers; repair the channel, or repeat the recording",
        .run + 1
    )]
    NotNumbers {
        /// Which recording, from 0.
        run: usize,
        /// The channel.
        channel: Channel,
        /// Readings that are not numbers.
        missing: usize,
        /// All readings.
        all: usize,
    },
    /// Readings that are impossible for a running machine.
    #[error("recording {}: {source}", .run + 1)]
    Implausible {
        /// Which recording, from 0.
        run: usize,
        /// The reason.
        source: Implausible,
    },
    /// The boundary conditions cannot drive the model.
    #[error("recording {}: its inputs cannot drive the model: {source}", .run + 1)]
    Inputs {
        /// Which recording, from 0.
        run: usize,
        /// The reason.
        source: InputsError,
    },
    /// No segments remain for the comparison.
    #[error(
        "no segment of the recordings can be compared with the model: readings are missing or not numbers, or all points lie at the surge line. Check the channels, their units, and the machine of the campaign"
    )]
    NothingComparable,
    /// The model cannot be driven by the recording.
    #[error(
        "the nominal model cannot follow recording {}: {source}. Check that it is a recording of the campaign's machine",
        .run + 1
    )]
    Drive {
        /// Which recording, from 0.
        run: usize,
        /// The reason.
        source: mapper_physics::simulation::driven::DriveError,
    },
    /// The statistics have no solution.
    #[error("the readings cannot be compared with the model: {0}")]
    Unsolvable(#[from] Unsolvable),
}

/// Why the statistics have no solution.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unsolvable {
    /// A covariance is not positive definite.
    #[error("the declared noise of a channel is 0 or not a number; declare its noise")]
    NoNoise,
    /// Readings or predictions are not finite.
    #[error("a reading, or the model's response to a parameter, is not finite")]
    NotFinite,
    /// Constants cannot be distinguished.
    #[error("constants of the campaign are not independent")]
    Dependent,
    /// No cause has an effect on a recorded channel.
    #[error("no cause of drift changes a recorded channel")]
    NothingShows,
    /// This cause has no effect on a recorded channel.
    #[error("{cause} does not change any recorded channel")]
    Hidden {
        /// The cause.
        cause: Cause,
    },
}

fn symbols(channels: &[Channel]) -> String {
    channels.iter().map(|channel| channel.symbol()).collect::<Vec<_>>().join(", ")
}
