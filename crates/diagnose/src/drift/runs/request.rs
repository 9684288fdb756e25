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
    /// Tolerances of the nominal machine, within which it has not drifted.
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

/// Why a recording cannot be examined at all.
#[derive(Debug, thiserror::Error)]
pub enum DriftError {
    /// No recording was given.
    #[error("no recording was given")]
    NoRun,
    /// Nothing was commanded.
    #[error("recording {}: it has no steps; commands that change make steps", .run + 1)]
    NoSteps {
        /// Which recording, from 0.
        run: usize,
    },
    /// Missing channels that are needed to judge drift.
    #[error("recording {}: it has no {}; drift is judged by all of N, P2, T1 and T2", .run + 1, symbols(.channels))]
    MissingChannels {
        /// Which recording, from 0.
        run: usize,
        /// The missing channels.
        channels: Vec<Channel>,
    },
    /// A channel with many invalid readings.
    #[error(
        "recording {}: {missing} of {all} readings of {channel} are not numbers; repair the channel, or record again",
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
    #[error("recording {}: its inputs cannot be used: {source}", .run + 1)]
    Inputs {
        /// Which recording, from 0.
        run: usize,
        /// The reason.
        source: InputsError,
    },
    /// No segments remain for the comparison.
    #[error(
        "no stretch of the recordings can be compared with the model: readings are missing or not numbers, or all of them lie at the surge line. Look at the channels and their units, and whether the campaign names the machine"
    )]
    NothingComparable,
    /// The model cannot be driven by the recording.
    #[error(
        "the nominal model cannot follow recording {}: {source}. Does the campaign name the machine that was recorded?",
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
    #[error("the noise of a channel is declared as 0 or is not a number; declare the noise it has")]
    NoNoise,
    /// Readings or predictions are not finite.
    #[error("a reading or the model's answer to a parameter is not finite")]
    NotFinite,
    /// Constants cannot be distinguished.
    #[error("constants of the campaign are not independent")]
    Dependent,
    /// No cause has an effect on what is recorded.
    #[error("no cause shows in the channels recorded")]
    NothingShows,
    /// This cause has no effect on what is recorded.
    #[error("{cause} does not show in the channels recorded")]
    Hidden {
        /// The cause.
        cause: Cause,
    },
}

fn symbols(channels: &[Channel]) -> String {
    channels.iter().map(|channel| channel.symbol()).collect::<Vec<_>>().join(", ")
}
