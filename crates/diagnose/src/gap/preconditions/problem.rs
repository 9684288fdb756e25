//! Conditions that prevent a diagnosis, reported instead of a wrong cause.

use crate::gap::residuals::study::PredictError;
use mapper_core::{Channel, step_number};
use mapper_observe::plausible::Implausible;

/// Condition that prevents a diagnosis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Problem {
    /// Nothing measured.
    #[error("the recording has no measured channel with samples; check its channel map")]
    Empty,
    /// No steps.
    #[error(
        "the recording has {steps} step(s), and no jump of P3 or valve is seen: a diagnosis needs jumps between at least 3 points; record a campaign, and map P3_command and valve_command"
    )]
    NoJumps {
        /// Steps found.
        steps: usize,
    },
    /// Too few outputs.
    #[error(
        "too little is measured: of N, m_c, P2, T2, Tc, m_t, T4 and Tt only {present}; at least N, P2 and T2 are needed"
    )]
    TooFewOutputs {
        /// Measured outputs.
        present: String,
    },
    /// Far from the nominal machine under the recorded inputs.
    #[error(
        "{channel} lies {percent:.0} % off what the nominal machine gives under the recorded P3, T3 and valve, at half of the steps or more: this is a recording of another machine, or a scale is wrong; check machine and map of the campaign"
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
    #[error("{channel} ({}) drives the model and is not recorded; without it no cause can be identified", .channel.info().description)]
    NoDriver {
        /// The channel.
        channel: Channel,
    },
    /// The valve opening is unknown.
    #[error(
        "the recording does not say how far the valve was open at step {}, and the model is driven with that: map it as `valve_command`, as commanded or as measured, or give it among `constants`; without it `mapper transient` diagnoses the compressor side from its measured neighbours",
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
        "the healthy recording has {healthy} step(s), the one under diagnosis {recorded}: only the same steps can be compared; record a healthy run of the same plan"
    )]
    OtherSteps {
        /// In the reference recording.
        healthy: usize,
        /// In the recording under diagnosis.
        recorded: usize,
    },
    /// A step differs between the recordings.
    #[error(
        "step {} of the healthy recording is another one: {what} {healthy:.3} {unit}, where the recording under diagnosis has {recorded:.3} {unit} (more than {within:.3} apart); record a healthy run of the same plan",
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
    #[error("the nominal model cannot follow this recording: {0}; is it of this machine?")]
    Predict(#[from] PredictError),
}
