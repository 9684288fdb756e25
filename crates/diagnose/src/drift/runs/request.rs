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
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum DriftError {
    #[error("no recording was given")]
    NoRun,
    #[error("recording {} has no steps: P3_command and valve_command are constant or missing; map them", .run + 1)]
    NoSteps { run: usize },
    #[error("recording {} has no {}; the drift diagnosis needs N, P2, T1 and T2", .run + 1, symbols(.channels))]
    MissingChannels { run: usize, channels: Vec<Channel> },
    #[error(
        "recording {}: {missing} of {all} readings of {channel} are not numbers; repair the channel, or repeat the recording",
        .run + 1
    )]
    NotNumbers { run: usize, channel: Channel, missing: usize, all: usize },
    #[error("recording {}: {source}", .run + 1)]
    Implausible { run: usize, source: Implausible },
    #[error("recording {}: its inputs cannot drive the model: {source}", .run + 1)]
    Inputs { run: usize, source: InputsError },
    #[error(
        "no segment of the recordings can be compared with the model: readings are missing or not numbers, or all points lie at the surge line. Check the channels, their units, and the machine of the campaign"
    )]
    NothingComparable,
    #[error(
        "the nominal model cannot follow recording {}: {source}. Check that it is a recording of the campaign's machine",
        .run + 1
    )]
    Drive { run: usize, source: mapper_physics::simulation::driven::DriveError },
    #[error("the readings cannot be compared with the model: {0}")]
    Unsolvable(#[from] Unsolvable),
}

/// Why the statistics have no solution.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum Unsolvable {
    /// A covariance is not positive definite.
    #[error("the declared noise of a channel is 0 or not a number; declare its noise")]
    NoNoise,
    #[error("a reading, or the model's response to a parameter, is not finite")]
    NotFinite,
    #[error("constants of the campaign are not independent")]
    Dependent,
    #[error("no cause of drift changes a recorded channel")]
    NothingShows,
    #[error("{cause} does not change any recorded channel")]
    Hidden { cause: Cause },
}

fn symbols(channels: &[Channel]) -> String {
    channels.iter().map(|channel| channel.symbol()).collect::<Vec<_>>().join(", ")
}
