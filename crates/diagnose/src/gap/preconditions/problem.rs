//! Conditions that prevent a diagnosis, reported instead of a wrong cause.

use crate::gap::residuals::study::PredictError;
use mapper_core::{Channel, step_number};
use mapper_observe::plausible::Implausible;

/// Condition that prevents a diagnosis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Problem {
    /// No measured channel.
    #[error("the recording has no measured channel with samples; check its channel map")]
    Empty,
    /// Too few jumps.
    #[error(
        "the recording has {steps} step(s) and too few jumps of P3 or valve: a diagnosis needs jumps between at least 3 points; record a campaign, and map P3_command and valve_command"
    )]
    NoJumps {
        /// Steps found.
        steps: usize,
    },
    /// Too few outputs.
    #[error(
        "too few channels are measured: of N, m_c, P2, T2, Tc, m_t, T4 and Tt only {present}; record at least N, P2 and T2"
    )]
    TooFewOutputs {
        /// Measured outputs.
        present: String,
    },
    /// Far from the nominal machine under the recorded inputs.
    #[error(
        "{channel} deviates by {percent:.0} % from the nominal machine under the recorded P3, T3 and valve, in at least half of the steps: the recording is of another machine, or a scale is wrong; check machine and map of the campaign"
    )]
    OtherMachine {
        /// The channel with the largest deviation.
        channel: Channel,
        /// Deviation, % of the nominal value (signed).
        percent: f64,
    },
    /// Readings that are impossible for a running machine.
    #[error(transparent)]
    Implausible(#[from] Implausible),
    /// A required input is missing.
    #[error("{channel} ({}) drives the model and is not recorded: record it and map its column", .channel.info().description)]
    NoDriver {
        /// The channel.
        channel: Channel,
    },
    /// The valve opening is unknown.
    #[error(
        "the valve opening of step {} is not recorded, but it drives the model: map the commanded or measured opening as `valve_command`, or give it among `constants`; without it, `mapper transient` diagnoses the compressor side from its measured neighbours",
        step_number(*step)
    )]
    NoValve {
        /// Index, from 0, of the first step with an unknown opening.
        step: usize,
    },
    /// Measured P3 is far from its command.
    #[error(
        "measured P3 is {measured_pa:.0} Pa where {commanded_pa:.0} Pa is commanded: the two do not belong together; check the channel map and the units"
    )]
    NotCommanded {
        /// Median of the measured P3 in a step, Pa.
        measured_pa: f64,
        /// Its command, Pa.
        commanded_pa: f64,
    },
    /// The reference recording has a different number of steps.
    #[error(
        "the healthy recording has {healthy} step(s), the recording under diagnosis {recorded}, but only equal steps can be compared: record a healthy run of the same plan"
    )]
    OtherSteps {
        /// In the reference recording.
        healthy: usize,
        /// In the recording under diagnosis.
        recorded: usize,
    },
    /// A step differs between the recordings.
    #[error(
        "step {} of the healthy recording differs: its {what} is {healthy:.3} {unit}, that of the recording under diagnosis {recorded:.3} {unit} (allowed difference {within:.3} {unit}); record a healthy run of the same plan",
        step_number(*step)
    )]
    OtherStep {
        /// Index of the step, from 0.
        step: usize,
        /// Differing quantity.
        what: &'static str,
        /// In the reference recording.
        healthy: f64,
        /// In the recording under diagnosis.
        recorded: f64,
        /// Unit of both.
        unit: &'static str,
        /// Maximum allowed difference.
        within: f64,
    },
}

/// Why a recording cannot be diagnosed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GapError {
    /// The recording does not fit the campaign, or required data are missing.
    #[error(transparent)]
    Recording(#[from] Problem),
    /// The nominal model cannot follow the recording.
    #[error(
        "the nominal model cannot follow this recording: {0}; check that the recording is of this machine"
    )]
    Predict(#[from] PredictError),
}
