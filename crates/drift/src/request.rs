//! What is asked, and why there may be no answer.

use mapper_core::Recording;
use mapper_identify::{IdentifyConfig, IdentifyError};
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;

/// A recording with what says whether it belongs to the others.
#[derive(Debug, Clone, Copy)]
pub struct RecordedRun<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// What campaign and machine it was made with, e.g. their hashes; `None` where that is not known.
    pub fingerprint: Option<&'a str>,
}

/// Runs of one machine, one after the other, with what is known of machine and rig.
#[derive(Debug, Clone, Copy)]
pub struct DriftRequest<'a> {
    /// The recordings in the order in which they were made.
    pub runs: &'a [RecordedRun<'a>],
    /// The nominal machine.
    pub model: &'a Model,
    /// Boundary conditions for what is not recorded.
    pub boundary: BoundaryConditions,
    /// Declared uncertainty, window, geometry.
    pub identification: &'a IdentifyConfig,
    /// Seed of the simulated drift-free campaigns that set the threshold.
    pub seed: u64,
}

/// Why a recording cannot be examined at all.
#[derive(Debug, thiserror::Error)]
pub enum DriftError {
    /// No recording was given.
    #[error("no recording was given")]
    NoRun,
    /// A recording has too little in it.
    #[error("recording {}: {message}", .run + 1)]
    Unusable {
        /// Which recording, from 0.
        run: usize,
        /// What is missing, and what to do.
        message: String,
    },
    /// The model cannot be driven by what was recorded.
    #[error(
        "the nominal model cannot follow recording {}: {source}. Does the campaign name the machine that was recorded?",
        .run + 1
    )]
    Drive {
        /// Which recording, from 0.
        run: usize,
        /// Why.
        source: mapper_physics::driven::DriveError,
    },
    /// The points cannot be identified.
    #[error("recording {}: {source}", .run + 1)]
    Identify {
        /// Which recording, from 0.
        run: usize,
        /// Why.
        source: IdentifyError,
    },
    /// The statistics have no solution: numbers that are not finite.
    #[error("the readings cannot be compared with the model: {message}")]
    Numbers {
        /// What was found.
        message: String,
    },
}
